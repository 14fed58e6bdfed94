"""A machine file that the demo and the benchmark write."""

EXAMPLE = """\
# A two-stage gearbox of our own invention
name = "demo gearbox"

[operating]
speed_rpm = 1480.0
torque_nm = 120.0

[[stage]]
kind = "parallel"
pinion_teeth = 23
gear_teeth = 57
module_mm = 2.5
face_width_mm = 28.0
bore_diameter_pinion_mm = 25.0
bore_diameter_gear_mm = 40.0

[[stage]]
kind = "parallel"
pinion_teeth = 19
gear_teeth = 62
module_mm = 3.5
face_width_mm = 36.0
bore_diameter_pinion_mm = 28.0
bore_diameter_gear_mm = 50.0
"""
