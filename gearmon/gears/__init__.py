"""Gears: geometry, kinematics, mesh stiffness and faults."""
