"""The same world in MuJoCo: a second opinion that nobody here wrote."""
