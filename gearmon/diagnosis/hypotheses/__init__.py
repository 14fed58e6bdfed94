"""What may explain a deviation from the healthy law: hypotheses that compete.

Damage of one tooth (`tooth_damage`, by `tooth_match` and `tooth_search`), of several teeth
(`several_teeth`), runout and wobble that grew (`runout`), a changed path to the sensor
(`changed_path`), and by physical rules the kinds that fill the turn of a gear (`fault_kinds`).
Without a reference the other teeth of a gear stand in for it (`own_teeth`).
"""
