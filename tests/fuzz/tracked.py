"""Files of tracking data and orbits that others write: good ones, small, and damaged ones with the command that reads them."""

import gzip
import random
import sys
from pathlib import Path

from tests.fuzz import mutate
from tests.fuzz.case import Case
from tests.fuzz.child import End

META = """META_START
TIME_SYSTEM = UTC
START_TIME = 2005-159T17:41:00
PARTICIPANT_1 = DSS-25
PARTICIPANT_2 = SAT
MODE = SEQUENTIAL
PATH = {path}
TIMETAG_REF = RECEIVE
INTEGRATION_INTERVAL = 1.0
INTEGRATION_REF = MIDDLE
FREQ_OFFSET = 32021035200.0
RANGE_MODE = COHERENT
RANGE_MODULUS = 32768.0
RANGE_UNITS = {unit}
ANGLE_TYPE = {angles}
REFERENCE_FRAME = EME2000
TURNAROUND_NUMERATOR = 240
TURNAROUND_DENOMINATOR = 221
DOPPLER_COUNT_SCALE = 1000
TRANSMIT_DELAY_1 = 0.000077
DATA_QUALITY = RAW
CORRECTION_RANGE = 0.5
CORRECTIONS_APPLIED = YES
META_STOP
DATA_START
COMMENT one = two
TRANSMIT_FREQ_1 = 2005-159T17:41:00 7180064367.3536
RECEIVE_FREQ_2 = 2005-06-08T17:41:00.5 -409.2735
RANGE = 2005-159T17:41:01 80452.7542
ANGLE_1 = 2005-159T17:41:01 256.64002393
ANGLE_2 = 2005-159T17:41:01 13.38100016
DOPPLER_INTEGRATED = 2005-159T17:41:02 -1.498776048
DOPPLER_COUNT = 2005-159T17:41:03 2
PRESSURE = 2005-159T17:41:03 1013.25
MAG = 2005-159T17:41:04 1e1
DATA_STOP
"""
HEAD = "CCSDS_TDM_VERS = 2.0\nCREATION_DATE = 2005-160T20:15:00\nORIGINATOR = X\n"
XML = """<?xml version="1.0" encoding="UTF-8"?>
<tdm id="CCSDS_TDM_VERS" version="2.0"><header><ORIGINATOR>X</ORIGINATOR></header><body>
<segment><metadata><TIME_SYSTEM>GPS</TIME_SYSTEM><PARTICIPANT_1>A</PARTICIPANT_1><PARTICIPANT_2>S</PARTICIPANT_2>
<PATH>1,2,1</PATH></metadata><data>
<observation><EPOCH>2005-06-08T17:41:00.000</EPOCH><RANGE>3.2E10</RANGE></observation>
<observation><EPOCH>2005-06-08T17:41:01</EPOCH><RECEIVE_FREQ>-409.2735</RECEIVE_FREQ></observation>
</data></segment></body></tdm>
"""
OBJECT = """OBJECT_NAME = A
OBJECT_ID = 2000-001A
CENTER_NAME = EARTH
REF_FRAME = {frame}
TIME_SYSTEM = {scale}
"""
OEM = """META_START
{object}REF_FRAME_EPOCH = 2019-09-09T00:00:00.0
START_TIME = 2019-09-09T00:00:00
USEABLE_START_TIME = 2019-09-09T00:00:00
STOP_TIME = 2019-09-09T00:02:00
INTERPOLATION = HERMITE
INTERPOLATION_DEGREE = 7
META_STOP
COMMENT states
2019-09-09T00:00:00 3156.6549969124 -5911.75730768957 -1096.379111314 4.69978050838 1.428120205 5.8859878
2019-252T00:01:00 3431.186799 -5812.5778184 -740.96976 4.447771 1.87663 5.9564733 0.001 0.001 -0.001
2019-09-09T00:02:00 3431.186799 -5812.5778184 -740.96976 4.447771 1.87663 5.9564733

COVARIANCE_START
EPOCH = 2019-09-09T00:00:00
COV_REF_FRAME = RTN
3.33e-04
4.61e-04 6.78e-04
-3.07e-04 -4.22e-04 3.23e-04
-3.34e-07 -4.68e-07 2.48e-07 4.29e-10
-2.21e-07 -2.86e-07 1.79e-07 2.60e-10 1.76e-10
-3.04e-07 -4.98e-07 3.54e-07 1.86e-10 1.00e-10 6.22e-10
COVARIANCE_STOP
"""
STATE = "X = {x} [km]\nY = 1239.6\nZ = -717.49\nX_DOT = -0.87316 [km/s]\nY_DOT = 8.74\nZ_DOT = -4.191\n"
EXTRA = """SEMI_MAJOR_AXIS = 7000 [km]
GM = 398600.4415 [km**3/s**2]
MASS = 1913.000 [kg]
DRAG_AREA = 10 [m**2]
MAN_EPOCH_IGNITION = 2000-06-03T09:00:34.1
MAN_DURATION = 132.60 [s]
MAN_DELTA_MASS = -18.418
MAN_REF_FRAME = RTN
MAN_DV_1 = -0.02325700 [km/s]
MAN_DV_2 = 0.01683160 [km/s]
MAN_DV_3 = -0.00893444 [km/s]
USER_DEFINED_X = y
"""
MEAN = """MEAN_ELEMENT_THEORY = SGP4
EPOCH = 2007-064T10:34:41.4264
MEAN_MOTION = 1.00273272
ECCENTRICITY = 0.0005013
INCLINATION = 3.0539
RA_OF_ASC_NODE = 81.7939
ARG_OF_PERICENTER = 249.2363
MEAN_ANOMALY = 150.1602
NORAD_CAT_ID = 23581
BSTAR = 0.0001
"""
TOKENS = r"""
= META_START META_STOP DATA_START DATA_STOP COVARIANCE_START COVARIANCE_STOP COMMENT EPOCH = RANGE ANGLE_1 UTC TAI TDB TCB
UT1 GPS MET 2005-366T00:00:00 1959-12-31T00:00:00 2016-12-31T23:59:60 9999-12-31T23:59:59.999999999 0000-00-00T00:00:00
PATH 1,2,1 2,1 1,9 [km] [m] [s] [deg] 1e308 1e-308 1D5 <!DOCTYPE <!ENTITY &a; <tdm> </tdm> <EPOCH> <segment> xmlns:a=
<![CDATA[ ]]> TIME_SYSTEM
"""
WORDS = (*TOKENS.split(), "\n", "\r", "\r\n", "\0", "\ufeff", " ", "\t", "COMMENT\n", "\nDATA_START\n", *mutate.HOSTILE)


def _xml(kind: str, body: str) -> str:
    """A KVN message's keywords as elements."""
    lines = [line.split(" = ") for line in body.splitlines() if " = " in line]
    words = "".join(f"<{key}>{value.split(' [')[0]}</{key}>" for key, value in lines)
    return f'<{kind} version="2.0"><body><segment><metadata>{words}</metadata></segment></body></{kind}>'


def gently(data: bytes, rng: random.Random) -> bytes:
    """A few changes that keep the form: a digit, a line gone, twice or elsewhere, a value or a keyword of another line."""
    lines = data.split(b"\n")
    for _ in range(1 + int(rng.expovariate(0.7))):
        i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
        one, other = lines[i].partition(b"= "), lines[j].partition(b"= ")
        way = rng.randrange(6)
        if way == 0:
            digits = [k for k, c in enumerate(lines[i]) if chr(c).isdigit()]
            if digits:
                k = rng.choice(digits)
                lines[i] = lines[i][:k] + rng.choice(b"0123456789-.e").to_bytes(1, "big") + lines[i][k + 1 :]
        elif way == 1 and len(lines) > 2:
            del lines[i]
        elif way == 2:
            lines.insert(j, lines[i])
        elif way == 3:
            lines.insert(j, lines.pop(i))
        elif way == 4 and one[1] and other[1]:
            lines[i] = one[0] + b"= " + other[2]
        elif one[1] and other[1]:
            lines[i] = other[0] + b"= " + one[2]
    return b"\n".join(lines)


class Tracked:
    """Good inputs of a format, and what is done with damaged ones; mixed into `Format`."""

    ending = ""

    def texts(self) -> list[str]:
        raise NotImplementedError

    def prepare(self, folder: Path) -> None:
        for text in self.texts():
            self.good += [text.encode(), text.replace("\n", "\r\n").encode()]  # type: ignore[attr-defined]

    def ahead(self, folder: Path) -> list[list[str]]:
        """Nothing is compiled; imports and tables are in memory once a good file was shown."""
        (folder / "a").write_bytes(self.good[0])  # type: ignore[attr-defined]
        return [["tracking", f"{folder}/a"], ["tracking", f"{folder}/a", "-o", f"{folder}/p.png"]] if self.ending else []

    def case(self, rng: random.Random) -> Case:
        data = self.damaged(rng, WORDS, lambda data: gently(data, rng), 0.6)  # type: ignore[attr-defined]
        if rng.random() < 0.05:
            data = mutate.bytewise(gzip.compress(data, 1, mtime=0), rng, WORDS, [data])
        way = rng.randrange(8)
        files = {"a": data}
        if way == 0:
            return Case(files, ["tracking", "a"])
        if way == 1:
            return Case(files, ["tracking", "a", "-o", "p.png"], makes=frozenset(["p.png"]))
        if way == 2:
            return Case(files, ["tracking", "a", "--to", "b.csv"], makes=frozenset(["b.csv"]))
        if way == 3:
            answers = ["--range", "two-way", "--tag", "transmit", "--sigma", "10m", "--interval", "1", "--angles", "apparent"]
            return Case(files, ["tracking", "a", "--json", *answers])
        if way < 6 and self.ending:
            target = f"b.{self.ending}"
            return Case(files, ["tracking", "a", "--to", target], makes=frozenset([target]), holds=_read_back(target))
        return Case(files, ["read_ephemeris"], call=_read_and_write)


def _read_back(target: str):
    """A file that was written is read as what it was made of."""

    def holds(end: End, folder: Path) -> list[str]:
        import piazzi as pz

        if end.status:
            return []
        try:
            one, other = pz.read_tracking(folder / "a"), pz.read_tracking(folder / target)
        except ValueError as error:
            return [f"what was written cannot be read: {error}"]
        return [] if len(one) == len(other) else [f"{len(one)} rows were written as {len(other)}"]

    return holds


def _read_and_write() -> int:
    """Read orbits, and write them again as each message that they fit."""
    import piazzi as pz
    from piazzi.formats.write_odm import oem_text, omm_text, opm_text

    try:
        found = pz.read_ephemeris("a")
        for arc in found.arcs:
            if len(arc) == 1:
                opm_text(arc, created="2020-01-01T00:00:00")
        if found.arcs:
            oem_text(found, created="2020-01-01T00:00:00")
        for mean in found.mean:
            omm_text(mean, created="2020-01-01T00:00:00")
    except (ValueError, OSError) as error:
        print("piazzi:", str(error), file=sys.stderr)
        return 2
    return 0


class Tdm(Tracked):
    """Tracking Data Messages, KVN and XML."""

    ending = "tdm"

    def texts(self) -> list[str]:
        one = META.format(path="1,2,1", unit="km", angles="AZEL")
        two = META.format(path="2,1", unit="RU", angles="RADEC")
        return [HEAD + one, HEAD + two + one.replace("RANGE_UNITS = km", "RANGE_UNITS = s"), XML]


class Oem(Tracked):
    """Orbit Ephemeris Messages, KVN and XML."""

    ending = "oem"

    def texts(self) -> list[str]:
        head = HEAD.replace("TDM", "OEM")
        one = OEM.format(object=OBJECT.format(frame="GCRF", scale="UTC"))
        state = "<stateVector><EPOCH>2019-09-09T00:00:00</EPOCH><X>7000</X><Y>0</Y><Z>0</Z><X_DOT>0</X_DOT><Y_DOT>7</Y_DOT>"
        data = f"<data>{state}<Z_DOT>0</Z_DOT></stateVector></data></segment>"
        xml = _xml("oem", OBJECT.format(frame="ITRF-97", scale="TAI")).replace("</segment>", data)
        return [head + one, head + one + one.replace("GCRF", "TEME"), xml]


class Opm(Tracked):
    """Orbit Parameter and Mean Elements Messages, KVN and XML."""

    def texts(self) -> list[str]:
        who = OBJECT.format(frame="TOD", scale="UTC")
        opm = HEAD.replace("TDM", "OPM") + who + "EPOCH = 1998-12-18T14:28:15.1172\n" + STATE.format(x=6503.5) + EXTRA
        omm = HEAD.replace("TDM", "OMM") + OBJECT.format(frame="TEME", scale="UTC") + MEAN
        plain = opm.split("MAN_EPOCH")[0].split("ORIGINATOR = X\n")[1]
        return [opm, omm, f"<ndm>{_xml('opm', plain)}{_xml('omm', omm.split('ORIGINATOR = X')[1])}</ndm>"]
