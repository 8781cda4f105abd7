"""Results in the files of other programs: `vanedamp export`. Each file of the folder `formats` is a format."""
