"""A classifier of kinds with probabilities that hold, and the freedom to say "none of these".

Small networks, one for each fold of the training data; their mean is softened by one temperature,
found on the examples that each network has not seen (Guo et al. 2017). What lies farther from all
classes than training examples do moves to the class for everything else.

References
----------
C. Guo, G. Pleiss, Y. Sun, K. Weinberger, On calibration of modern neural networks, ICML 2017.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar
from scipy.spatial.distance import cdist
from scipy.special import expit, log_softmax, softmax
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.covariance import LedoitWolf
from sklearn.exceptions import ConvergenceWarning
from sklearn.model_selection import StratifiedKFold
from sklearn.neural_network import MLPClassifier
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

from gearmon.arrays import FloatArray
from gearmon.diagnosis.fault_types.kinds import NONE
from gearmon.errors import ArgumentError
from gearmon.files import reading_archive, write_archive

FORMAT = "gearmon kind classifier 1"
#: Folds of the training data, and networks; neurons, L2 penalty and steps of each.
_FOLDS, _NEURONS, _DECAY, _STEPS = 4, 40, 10.0, 250
#: Standard deviations at which a feature is cut.
_CUT = 6.0
#: Share of training examples nearer than the distance at which novelty begins.
_INSIDE = 0.995
#: Beyond that distance, relative to it, half of the probability has moved; and how sharply.
_HALF_BEYOND, _SHARPNESS = 1.3, 12.0


class KindClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """Kinds of fault from features.

    Parameters
    ----------
    random_state : int, RandomState or None
        Of folds and initial weights.

    Attributes
    ----------
    classes_ : ndarray
        Classes, sorted. That of everything else, `kinds.NONE`, takes what is like nothing seen.
    temperature_ : float
        By which the logits are divided.
    n_features_in_ : int
        Features.
    machine_ : str
        Teeth of the machine that it was trained for; "" if nobody told.

    Examples
    --------
    >>> import numpy as np
    >>> x, kinds = np.linspace(0.0, 9.0, 90), np.repeat(["a", "b", "c"], 30)
    >>> trained = KindClassifier(random_state=0).fit(x[:, None], kinds)
    >>> trained.predict([[0.5], [4.5]]).tolist()
    ['a', 'b']
    """

    def __init__(self, random_state: Any = None) -> None:
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Train.

        Parameters
        ----------
        X : array_like of float, shape (examples, features)
            Features.
        y : array_like, shape (examples,)
            Kinds: three or more, of four examples each at least.

        Returns
        -------
        KindClassifier
            Itself.

        Raises
        ------
        ValueError
            If the data are not what scikit-learn asks of training data.
        """
        rows, labels = validate_data(self, X, y, dtype=np.float64)
        self.classes_, codes = np.unique(labels, return_inverse=True)
        self.mean_, spread = rows.mean(axis=0), rows.std(axis=0)
        self.scale_ = np.where(spread > 1e-9 * np.maximum(np.abs(self.mean_), 1.0), spread, 1.0)
        scaled, self.machine_ = self._scaled(rows), ""
        random, each = check_random_state(self.random_state), np.arange(len(rows))
        folds = StratifiedKFold(n_splits=_FOLDS, shuffle=True, random_state=random)
        size = {"hidden_layer_sizes": (_NEURONS,), "alpha": _DECAY, "max_iter": _STEPS}
        unseen_by, networks = np.empty(len(rows), dtype=np.intp), []
        for fold, (kept, held) in enumerate(folds.split(scaled, codes)):
            unseen_by[held] = fold
            seed = random.randint(2**31 - 1)
            network = MLPClassifier(activation="tanh", solver="lbfgs", random_state=seed, **size)
            with warnings.catch_warnings():
                # stopping early is a choice: the temperature corrects what it costs
                warnings.simplefilter("ignore", ConvergenceWarning)
                network.fit(scaled[kept], codes[kept])
            (first, second), (bias, end) = network.coefs_, network.intercepts_
            networks.append([first, bias, second, end])
        self.networks_ = [np.stack(part) for part in zip(*networks, strict=True)]
        # the temperature is found on what each network has not seen
        unseen = self._logits(scaled)[unseen_by, each]

        def entropy(log_temperature: float) -> float:
            told = log_softmax(unseen / np.exp(log_temperature), axis=1)
            return -float(np.mean(told[each, codes]))

        # between 1/20 and 20
        best = minimize_scalar(entropy, bounds=(-3.0, 3.0), method="bounded")
        self.temperature_ = float(np.exp(best.x))
        self.centres_ = np.array([scaled[codes == own].mean(axis=0) for own in np.unique(codes)])
        inner = LedoitWolf(assume_centered=True).fit(scaled - self.centres_[codes]).covariance_
        self.whitener_ = np.linalg.inv(np.linalg.cholesky(inner + 1e-6 * np.eye(len(inner)))).T
        self.reach_ = max(float(np.quantile(self._distance(scaled), _INSIDE)), 1e-9)
        return self

    def predict_proba(self, X: ArrayLike) -> FloatArray:
        """Return the probability of each class.

        Parameters
        ----------
        X : array_like of float, shape (rows, features)
            Features.

        Returns
        -------
        ndarray of float, shape (rows, classes)
            In the order of `classes_`; rows sum to 1.
        """
        check_is_fitted(self)
        rows = validate_data(self, X, dtype=np.float64, reset=False)
        logits = self._logits(self._scaled(rows)).mean(axis=0)
        probability = softmax(logits / self.temperature_, axis=1)
        other = self.classes_ == NONE
        if other.any():
            strange = expit(_SHARPNESS * (self.novelty(rows) / _HALF_BEYOND - 1.0))[:, None]
            probability = probability * (1.0 - strange) + strange * other
        return np.asarray(probability)

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Return the most probable class of each row."""
        best = np.argmax(self.predict_proba(X), axis=1)
        return np.asarray(self.classes_[best])

    def novelty(self, rows: FloatArray) -> FloatArray:
        """Return how far rows are from the nearest class, 1 where training examples end.

        Notes
        -----
        Mahalanobis distance with the pooled covariance within classes, over its 99.5 % quantile
        among the training examples.
        """
        plain = (np.asarray(rows, dtype=np.float64) - self.mean_) / self.scale_
        return np.asarray(self._distance(plain) / self.reach_)

    def _distance(self, scaled: FloatArray) -> FloatArray:
        whitened = cdist(scaled @ self.whitener_, self.centres_ @ self.whitener_)
        return np.asarray(whitened.min(axis=1))

    def _scaled(self, rows: FloatArray) -> FloatArray:
        return np.asarray(np.clip((rows - self.mean_) / self.scale_, -_CUT, _CUT))

    def _logits(self, scaled: FloatArray) -> FloatArray:
        """Return what each network says, shape (networks, rows, classes)."""
        first, bias, second, end = self.networks_
        return np.asarray(np.tanh(scaled @ first + bias[:, None]) @ second + end[:, None])


_ARRAYS = ("classes_", "mean_", "scale_", "centres_", "whitener_")


def write_kinds(classifier: KindClassifier, path: str | Path) -> None:
    """Store a trained classifier in one file: arrays and a JSON header, no code.

    Parameters
    ----------
    classifier : KindClassifier
        Trained on text labels, with a whole number or nothing as random state.
    path : str or Path
        The file; any name.

    Raises
    ------
    ArgumentError
        If it is not trained, or the file cannot be written.
    """
    if not hasattr(classifier, "classes_"):
        raise ArgumentError("the classifier is not trained; call fit before it is stored")
    header = {name: getattr(classifier, f"{name}_") for name in ("temperature", "reach", "machine")}
    header |= {"format": FORMAT, "settings": classifier.get_params()}
    header["networks"] = len(classifier.networks_[0])
    arrays = {name: np.asarray(getattr(classifier, name)) for name in _ARRAYS}
    arrays["classes_"] = arrays["classes_"].astype(str)
    for part, stacked in enumerate(classifier.networks_):
        arrays |= {f"{row}/{part}": values for row, values in enumerate(stacked)}
    write_archive(path, header, arrays)


def read_kinds(path: str | Path) -> KindClassifier:
    """Read a stored classifier.

    Parameters
    ----------
    path : str or Path
        A file written by `write_kinds`.

    Raises
    ------
    SignatureError
        If the file is missing, is no classifier, or is damaged.
    """
    told_of = "kind classifier", "train it", "train a classifier and store it"
    with reading_archive(path, (FORMAT,), *told_of) as (header, arrays):
        classifier = KindClassifier(header["settings"]["random_state"])
        for name in _ARRAYS:
            setattr(classifier, name, arrays[name])
        rows = range(header["networks"])
        classifier.networks_ = [
            np.stack([arrays[f"{row}/{part}"] for row in rows]) for part in range(4)
        ]
        classifier.temperature_ = float(header["temperature"])
        classifier.reach_ = float(header["reach"])
        classifier.machine_ = str(header.get("machine", ""))
        classifier.n_features_in_ = len(classifier.mean_)
        # a file may be damaged and still be an archive: what no training gives is refused
        classes, scales = classifier.classes_, [classifier.reach_, classifier.temperature_]
        parts = [np.array(scales), *(arrays[name] for name in _ARRAYS[1:]), *classifier.networks_]
        sound = all(part.dtype.kind == "f" and np.isfinite(part).all() for part in parts)
        if not sound or min(*scales, *classifier.scale_) <= 0:
            raise ValueError("its numbers cannot be")
        if classes.dtype.kind != "U" or not 0 < classes.size == len(set(classes.tolist())):
            raise ValueError("its kinds cannot be")
        # what does not fit together cannot be multiplied
        shares = classifier.predict_proba(np.zeros((1, classifier.n_features_in_)))
        if shares.shape != (1, len(classes)):
            raise ValueError("its numbers do not fit together")
    return classifier
