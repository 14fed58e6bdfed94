"""Which type of fault it is: features that no sensor decides, and a classifier trained on physics.

`kind_features` condenses an analysis to numbers that tell one type from another. `train_kinds`
draws machines with every type of fault, superposed from the order lines of one machine file, and
trains a `KindClassifier` on them, so that no recording of a fault is needed; `write_kinds` and
`read_kinds` keep it in a file. `kind_of_analysis` judges an analysis. ::

    classifier = train_kinds(machine)
    print(kind_of_analysis(analysis, reference, classifier).probabilities)

The names load what they need when they are first used: judging by rules needs no scikit-learn.
"""

from gearmon.lazy import lazily

_OFFERED = {
    "classifier": ("KindClassifier", "read_kinds", "write_kinds"),
    "kinds": ("FEATURES", "KINDS", "NAMES", "NONE", "kind_features", "kind_of_analysis"),
    "training": ("train_kinds",),
}

__all__, __getattr__ = lazily(__name__, _OFFERED)
