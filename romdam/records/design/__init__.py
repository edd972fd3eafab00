"""Records for design: target spectra, scaling, selection and matching."""
