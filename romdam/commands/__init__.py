"""The commands of `romdam`: arguments in, one call, what it says; a file for each group."""
