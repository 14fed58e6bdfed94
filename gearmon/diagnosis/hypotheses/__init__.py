"""What may explain a deviation from the healthy law: hypotheses that compete.

Damage of one tooth (`tooth_damage`, by `tooth_match` and `mesh_harmonics`), of several teeth
(`several_teeth`), runout and wobble that grew, and what the turn of a gear shows without a law
(`turns`).
"""
