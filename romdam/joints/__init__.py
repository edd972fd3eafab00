"""Gap elements: the laws at one gap, and the implicit problem of all gaps together."""
