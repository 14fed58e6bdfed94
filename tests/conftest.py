"""What all tests share: one thread for linear algebra, a repeatable hypothesis, simulations."""

from __future__ import annotations

import os

# must stand before the first import of NumPy: its libraries read these once
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

import gc
import gzip
import json
import re
import shutil
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from reference.simulated_machines import planetary, two_stages

from gearmon.simulation import SimulatedRecording, simulate

# One number of examples for all laws: a law that is wrong is wrong nearly everywhere. More of them,
# and others every time: pytest --hypothesis-profile=long
_ALWAYS = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("gearmon", max_examples=12, derandomize=True, **_ALWAYS)
settings.register_profile("long", max_examples=200, **_ALWAYS)
settings.load_profile("gearmon")

# Real recordings are no part of the project; where they lie beside it they are tested as well.
_RECORDINGS = Path(__file__).resolve().parents[1] / ".." / "shared" / "recordings"


# What they share is made once for a file, and in these folders once for all.
_SHARING = ("tests/report", "tests/study")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Give tests that share what is slow to make to one worker, whole files at the least."""
    from xdist.scheduler import LoadScopeScheduling

    class ByWhatIsShared(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return next((folder for folder in _SHARING if file.startswith(folder)), file)

    # in the order of the folders, slow ones first; not by number of tests
    config.option.loadscopereorder = False
    return ByWhatIsShared(config, log)


def pytest_sessionstart() -> None:
    """Do not look for garbage among what the tests are made of; it lasts as long as they do."""
    gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(10_000)
    gc.enable()


@pytest.fixture(scope="session")
def recordings_folder() -> Path:
    """Folder of real recordings; the test is skipped where there is none."""
    if not (_RECORDINGS / "metadata.csv").is_file():
        pytest.skip("no real recordings beside the checkout")
    return _RECORDINGS


@pytest.fixture(scope="session")
def two_stage_recording() -> SimulatedRecording:
    """Two healthy stages, 0.5 % wander, 20 dB noise; two accelerometers, a tacho on shaft 1."""
    return simulate(
        two_stages(), (), 8.0, 8000.0, seed=2, channels=2, speed_drift=0.005, tacho_shaft=1
    )


@pytest.fixture(scope="session")
def planetary_recording() -> SimulatedRecording:
    """A healthy planetary set with three planets that do not divide the ring's teeth."""
    return simulate(planetary(), (), 4.0, 8000.0, seed=3, channels=2)


@pytest.fixture(scope="module")
def browser():
    """Chromium without a window; the test is skipped where there is none."""
    webdriver = pytest.importorskip("selenium.webdriver")
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
    driver = shutil.which("chromedriver")
    if not found or not driver:
        pytest.skip("no Chromium with its driver on this machine")
    options = webdriver.ChromeOptions()
    options.binary_location = found
    for option in ("headless=new", "no-sandbox", "disable-gpu", "disable-dev-shm-usage"):
        options.add_argument(f"--{option}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    own = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    own.set_page_load_timeout(60)
    yield own
    own.quit()


@pytest.fixture(scope="session")
def fits_schema() -> Callable[[str, dict[str, Any]], None]:
    """Hold what a command prints with --json against its schema, which must say something."""
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(resources.files("gearmon.commands").joinpath("schemas.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)

    def fits(command: str, answer: dict[str, Any]) -> None:
        own = jsonschema.Draft202012Validator(schema | {"$ref": f"#/$defs/{command}"})
        own.validate(answer)
        few = _first_of_lists(answer)
        assert own.is_valid(few)
        for name in schema["$defs"][command]["required"]:
            assert not own.is_valid({key: few[key] for key in few if key != name})

    return fits


def _first_of_lists(value: Any) -> Any:
    """Leave one entry of every list: what it lacks is found without looking at the others."""
    if isinstance(value, dict):
        return {key: _first_of_lists(entry) for key, entry in value.items()}
    return [_first_of_lists(entry) for entry in value[:1]] if isinstance(value, list) else value


@pytest.fixture(scope="session")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a machine file, recordings, a reference, and things that are none of these."""
    from reference.small_gearbox import CRACK, HEALTHY_LOADS, MACHINE_FILE, simulated
    from reference.synthetic_signals import white

    from gearmon.cli import main
    from gearmon.simulation import write_simulation

    folder = tmp_path_factory.mktemp("shop")
    (folder / "machine.toml").write_text(MACHINE_FILE)
    for seed, load in enumerate(HEALTHY_LOADS):
        write_simulation(simulated(load=load, seed=seed), folder / f"healthy-{seed}.csv")
    write_simulation(simulated(), folder / "new.csv")
    write_simulation(simulated(CRACK), folder / "cracked.csv")
    write_simulation(simulated(), folder / "no-time.csv", with_time=False)
    noise = [f"{i / 10_000:.4f},{value:.5g}" for i, value in enumerate(white(20_000, seed=3))]
    (folder / "noise.csv").write_text("time (s),a1 (m/s2)\n" + "\n".join(noise) + "\n")
    (folder / "letter.txt").write_text("Dear reader,\nthis is a letter.\n")
    (folder / "empty.csv").write_text("")
    (folder / "bytes.bin").write_bytes(np.random.default_rng(0).bytes(4000))
    (folder / "cut.csv.gz").write_bytes(gzip.compress(b"a1\n" + b"1.5\n" * 4000)[:-20])
    (folder / "broken.toml").write_text("name = \n")
    keys = {"file": "machine.toml", "reference": "healthy.ref", "recordings": "."}
    listed = "".join(f'{key} = "{name}"\n' for key, name in keys.items())
    listed += "name = 'drive'\npattern = 'drive-(?P<time>.*)\\.csv'\n"
    (folder / "fleet.toml").write_text(f"[[machine]]\n{listed}")
    (folder / "other.toml").write_text(MACHINE_FILE.replace("= 57", "= 61"))
    (folder / "bare.toml").write_text(re.sub(r"(module|face|torque).*\n", "", MACHINE_FILE))
    (folder / "folder").mkdir()
    learned = [str(folder / f"healthy-{seed}.csv") for seed in range(3)]
    machine = ["--machine", str(folder / "machine.toml")]
    assert main(["learn", *learned, *machine, "-o", str(folder / "healthy.ref")]) == 0
    return folder
