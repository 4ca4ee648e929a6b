"""Compiled loops over thousands of postures: kinematics, laying onto a surface, clearance."""
