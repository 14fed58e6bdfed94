"""What may explain a deviation from the healthy law: hypotheses that compete.

Damage of one tooth (`tooth_damage`, by `tooth_match`), of several teeth (`several_teeth`), runout
and wobble that grew (`runout`). Without a reference the other teeth of a gear stand in for it
(`own_teeth`).
"""
