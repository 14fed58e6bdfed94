"""The law of the healthy machine: what its next recording should look like, and how surely.

A healthy machine depends smoothly on its operating state. What is known of it, the complex lines of
every gear and the levels of all families of lines and of the broadband spectrum, is predicted for
the state of a new recording from the references at hand, with a variance that is prior knowledge
where references are few or far away, and shrinks as they come near. What departs from the
prediction by more than that variance is evidence of a change: `gear_lines` for the pattern of one
gear around its turn (`patterns` turns it to that of another recording), `machine` for families of
lines and the spectrum between them.

>>> from gearmon.diagnosis.law.gear_lines import Kriging
>>> import numpy as np
>>> alone = Kriging(np.zeros((1, 2)), np.array([0.5, 0.0]), 0.06, 0.5)
>>> between = Kriging(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.5, 0.0]), 0.06, 0.5)
>>> between.weights.round(3).tolist(), bool(between.spread < alone.spread)
([0.5, 0.5], True)
"""
