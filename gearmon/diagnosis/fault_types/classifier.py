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
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar
from scipy.spatial.distance import cdist
from scipy.special import expit, log_softmax, softmax

from gearmon.diagnosis.fault_types.features import NONE
from gearmon.files import reading_archive, write_archive

FloatArray = NDArray[np.float64]

FORMAT = "gearmon kind classifier 2"
#: Neurons of each network, L2 penalty of their weights, most steps of the optimiser; and networks.
_HIDDEN, _DECAY, _STEPS, _FOLDS = 40, 10.0, 250, 4
#: Standard deviations at which a feature is cut.
_CUT = 6.0
#: Share of training examples nearer than the distance at which novelty begins.
_INSIDE = 0.995
#: Beyond that distance, relative to it, half of the probability has moved; and how sharply.
_HALF_BEYOND, _SHARPNESS = 1.3, 12.0


@dataclass(frozen=True, kw_only=True, eq=False)
class KindClassifier:
    """Probabilities of kinds of fault from features, in the names of scikit-learn's classifiers.

    Parameters
    ----------
    machine_ : str
        Teeth of the machine that it was trained for; "" if nobody told.
    classes_ : ndarray of str, shape (kinds,)
        Kinds, sorted.
    mean_, scale_ : ndarray of float, shape (features,)
        By which features are scaled.
    centres_ : ndarray of float, shape (kinds, features)
        Means of the kinds, scaled.
    whitener_ : ndarray of float, shape (features, features)
        Makes the covariance within kinds one.
    reach_ : float, > 0
        Distance from the nearest centre, whitened, at which novelty begins.
    temperature_ : float, > 0
        By which the logits are divided.
    first_, bias_, second_, end_ : ndarray of float
        Of every network, shapes (networks, features, neurons), (networks, 1, neurons),
        (networks, neurons, kinds), (networks, 1, kinds).

    Raises
    ------
    ValueError
        If the numbers do not fit together: a file may be damaged and still be an archive.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.repeat([[0.0, 0.1], [5.0, 0.1], [0.0, 7.0]], 8, axis=0)
    >>> trained = KindClassifier.trained(x + 0.1 * np.eye(24, 2), np.repeat(["a", "b", "c"], 8))
    >>> trained.predict([[0.05, 0.0], [5.05, 0.0]]).tolist()
    ['a', 'b']
    """

    machine_: str
    classes_: NDArray[np.str_]
    mean_: FloatArray
    scale_: FloatArray
    centres_: FloatArray
    whitener_: FloatArray
    reach_: float
    temperature_: float
    first_: FloatArray
    bias_: FloatArray
    second_: FloatArray
    end_: FloatArray

    def __post_init__(self) -> None:
        """Refuse what no training gives."""
        kinds, features, (nets, _, hidden) = len(self.classes_), len(self.mean_), self.bias_.shape
        shapes = {
            "mean_": (features,),
            "scale_": (features,),
            "centres_": (kinds, features),
            "whitener_": (features, features),
            "first_": (nets, features, hidden),
            "bias_": (nets, 1, hidden),
            "second_": (nets, hidden, kinds),
            "end_": (nets, 1, kinds),
        }
        for name, shape in shapes.items():
            own = getattr(self, name)
            if own.shape != shape or own.dtype.kind != "f" or not np.isfinite(own).all():
                raise ValueError("its numbers do not fit together")
        if self.classes_.dtype.kind != "U" or not 0 < kinds == len(set(self.classes_)) or not nets:
            raise ValueError("its kinds or networks are missing")
        scales = np.array([*self.scale_, self.reach_, self.temperature_], dtype=np.float64)
        if not ((scales > 0) & (scales < np.inf)).all():
            raise ValueError("its scales cannot be")

    @classmethod
    def trained(
        cls, rows: ArrayLike, kinds: ArrayLike, machine: str = "", seed: int = 0
    ) -> KindClassifier:
        """Train.

        Parameters
        ----------
        rows : array_like of float, shape (examples, features)
            Features.
        kinds : array_like of str, shape (examples,)
            Three kinds at least, of each as many as there are folds.
        machine : str
            Teeth of the machine.
        seed : int, >= 0
            Of folds and initial weights.
        """
        from sklearn.covariance import LedoitWolf
        from sklearn.model_selection import StratifiedKFold

        table, random = np.asarray(rows, dtype=np.float64), np.random.RandomState(seed)
        classes, codes = np.unique(np.asarray(kinds, dtype=np.str_), return_inverse=True)
        mean, spread = table.mean(axis=0), table.std(axis=0)
        scale = np.where(spread > 1e-9 * np.maximum(np.abs(mean), 1.0), spread, 1.0)
        scaled = _scaled(table, mean, scale)
        splits = StratifiedKFold(n_splits=_FOLDS, shuffle=True, random_state=random)
        unseen, networks = np.zeros((len(table), len(classes))), []
        for kept, held in splits.split(scaled, codes):
            networks.append(_network(scaled[kept], codes[kept], random))
            unseen[held] = _logits(scaled[held], *networks[-1])

        def entropy(log_temperature: float) -> float:
            told = log_softmax(unseen / np.exp(log_temperature), axis=1)
            return -float(np.mean(told[np.arange(len(codes)), codes]))

        # between 1/20 and 20
        best = minimize_scalar(entropy, bounds=(-3.0, 3.0), method="bounded")
        centres = np.array([scaled[codes == code].mean(axis=0) for code in range(len(classes))])
        inner = LedoitWolf(assume_centered=True).fit(scaled - centres[codes]).covariance_
        whitener = np.linalg.inv(np.linalg.cholesky(inner + 1e-6 * np.eye(len(inner)))).T
        distance = _distance(scaled, centres, whitener)
        first, bias, second, end = (np.array(part) for part in zip(*networks, strict=True))
        return cls(
            machine_=machine,
            classes_=classes,
            mean_=mean,
            scale_=scale,
            centres_=centres,
            whitener_=whitener,
            reach_=max(float(np.quantile(distance, _INSIDE)), 1e-9),
            temperature_=float(np.exp(best.x)),
            first_=first,
            bias_=bias,
            second_=second,
            end_=end,
        )

    @property
    def n_features_in_(self) -> int:
        """Number of features."""
        return len(self.mean_)

    def predict_proba(self, rows: ArrayLike) -> FloatArray:
        """Return the probability of each kind.

        Parameters
        ----------
        rows : array_like of float, shape (rows, features)
            Features.

        Returns
        -------
        ndarray of float, shape (rows, kinds)
            In the order of `classes_`; rows sum to 1.
        """
        scaled = _scaled(np.asarray(rows, dtype=np.float64), self.mean_, self.scale_)
        logits = _logits(scaled, self.first_, self.bias_, self.second_, self.end_).mean(axis=0)
        probability = softmax(logits / self.temperature_, axis=1)
        escape = self.classes_ == NONE
        if escape.any():
            strange = expit(_SHARPNESS * (self.novelty(rows) / _HALF_BEYOND - 1.0))[:, None]
            probability = probability * (1.0 - strange) + strange * escape
        return np.asarray(probability)

    def predict(self, rows: ArrayLike) -> NDArray[np.str_]:
        """Return the most probable kind of each row."""
        return np.asarray(self.classes_[np.argmax(self.predict_proba(rows), axis=1)])

    def novelty(self, rows: ArrayLike) -> FloatArray:
        """Return how far rows are from the nearest kind, 1 where training examples end.

        Notes
        -----
        Mahalanobis distance with the pooled covariance within kinds, over its 99.5 % quantile
        among the training examples.
        """
        plain = (np.asarray(rows, dtype=np.float64) - self.mean_) / self.scale_
        return _distance(plain, self.centres_, self.whitener_) / self.reach_


def _scaled(rows: FloatArray, mean: FloatArray, scale: FloatArray) -> FloatArray:
    return np.asarray(np.clip((rows - mean) / scale, -_CUT, _CUT))


def _distance(scaled: FloatArray, centres: FloatArray, whitener: FloatArray) -> FloatArray:
    return np.asarray(cdist(scaled @ whitener, centres @ whitener).min(axis=1))


def _logits(
    rows: FloatArray, first: FloatArray, bias: FloatArray, second: FloatArray, end: FloatArray
) -> FloatArray:
    return np.asarray(np.tanh(rows @ first + bias) @ second + end)


def _network(
    rows: FloatArray, codes: NDArray[np.intp], random: np.random.RandomState
) -> tuple[FloatArray, ...]:
    """Return the weights of a network that was fitted to some examples."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier

    network = MLPClassifier(
        hidden_layer_sizes=(_HIDDEN,),
        activation="tanh",
        solver="lbfgs",
        alpha=_DECAY,
        max_iter=_STEPS,
        random_state=random.randint(2**31 - 1),
    )
    with warnings.catch_warnings():
        # stopping early is a choice: the temperature corrects what it costs
        warnings.simplefilter("ignore", ConvergenceWarning)
        network.fit(rows, codes)
    (first, second), (bias, end) = network.coefs_, network.intercepts_
    return first, bias[None], second, end[None]


def write_kinds(classifier: KindClassifier, path: str | Path) -> None:
    """Store a trained classifier in one file: arrays and a JSON header, no code.

    Parameters
    ----------
    classifier : KindClassifier
    path : str or Path
        The file; any name.

    Raises
    ------
    ArgumentError
        If the file cannot be written.
    """
    parts = {field.name: getattr(classifier, field.name) for field in fields(classifier)}
    arrays = {name: part for name, part in parts.items() if isinstance(part, np.ndarray)}
    plain = {name: part for name, part in parts.items() if name not in arrays}
    write_archive(path, {"format": FORMAT, "plain": plain}, arrays)


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
        plain = header["plain"]
        parts: dict[str, Any] = dict(arrays)
        parts |= {name: float(plain[name]) for name in ("reach_", "temperature_")}
        return KindClassifier(machine_=str(plain["machine_"]), **parts)
