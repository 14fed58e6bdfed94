"""The classifier as scikit-learn wants it, its escape for the unknown, and its files."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import cross_val_score

from gearmon.diagnosis.fault_types import NONE, KindClassifier, read_kinds, write_kinds
from gearmon.errors import ArgumentError, SignatureError


def blobs(count=60, seed=0):
    random = np.random.default_rng(seed)
    centre = {"wear": (0.0, 6.0), "eccentricity": (6.0, 0.0), NONE: (0.0, 0.0)}
    rows = [random.normal(centre[kind], 1.0, (count, 2)) for kind in centre]
    return np.concatenate(rows), np.repeat(list(centre), count)


@pytest.fixture(scope="module")
def trained():
    return KindClassifier(random_state=0).fit(*blobs())


def test_tools_of_scikit_learn_take_it():
    rows, kinds = blobs()
    told = cross_val_score(KindClassifier(random_state=0), rows, kinds, cv=3)
    assert told.min() > 0.9
    with pytest.raises(NotFittedError):
        KindClassifier().predict(rows)
    with pytest.raises(ValueError, match="NaN"):
        KindClassifier().fit(np.full_like(rows, np.nan), kinds)


def test_it_tells_what_lies_apart(trained):
    rows, kinds = blobs(seed=1)
    told = trained.predict(rows)
    assert np.mean(told == kinds) > 0.97
    shares = trained.predict_proba(rows)
    assert np.allclose(shares.sum(axis=1), 1.0)
    assert (shares >= 0).all()


def test_what_is_like_nothing_seen_is_none_of_these(trained):
    strange = np.array([[60.0, 60.0], [-50.0, 0.0], [0.0, -70.0], [1e6, 3.0]])
    assert (trained.novelty(strange) > 3).all()
    assert (trained.predict(strange) == NONE).all()
    assert (trained.predict_proba(strange).max(axis=1) > 0.99).all()


def test_without_such_a_class_there_is_no_escape():
    rows, kinds = blobs()
    told = KindClassifier(random_state=0).fit(rows, np.where(kinds == NONE, "looseness", kinds))
    assert told.predict_proba([[60.0, 60.0]]).max() < 0.99


def test_the_same_seed_gives_the_same_classifier(trained):
    again = KindClassifier(random_state=0).fit(*blobs())
    rows, _ = blobs(seed=3)
    assert np.array_equal(again.predict_proba(rows), trained.predict_proba(rows))


def test_files_keep_every_probability(trained, tmp_path):
    path = tmp_path / "kinds.npz"
    write_kinds(trained, path)
    rows, _ = blobs(seed=4)
    back = read_kinds(path)
    assert np.array_equal(back.predict_proba(rows), trained.predict_proba(rows))
    assert back.classes_.tolist() == trained.classes_.tolist()
    assert back.get_params() == trained.get_params()


def test_damaged_files_are_refused(trained, tmp_path):
    path = tmp_path / "kinds.npz"
    with pytest.raises(SignatureError, match="no such file"):
        read_kinds(path)
    write_kinds(trained, path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(SignatureError, match="not a readable"):
        read_kinds(path)
    np.savez(path, header=np.frombuffer(b'{"format": "other"}', dtype=np.uint8))
    with pytest.raises(SignatureError, match="train it anew"):
        read_kinds(path)
    with pytest.raises(ArgumentError, match="not trained"):
        write_kinds(KindClassifier(), path)
