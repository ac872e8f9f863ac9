"""``piazzi ephemeris``: where and when an orbit is seen from a station."""

from __future__ import annotations

import click

from piazzi.cli import options, output
from piazzi.cli.running import DONE

ENDINGS = (".csv", ".nc", ".cpf")


@click.command(cls=options.Command)
@click.argument("orbit", metavar="ORBIT")
@click.option(
    "--from", "station", metavar="STATION", required=True, help="Name or code, or 'lat=50.1deg lon=8.6deg height=100m'."
)
@click.option(
    "--when", metavar="'A .. B'", default="tonight", show_default=True, help="Dates with their scale, 'A .. +6h', or tonight."
)
@click.option("--step", metavar="TIME", default="60s", show_default=True, help="Between rows.")
@click.option("--passes", is_flag=True, help="Rise, culmination and set of every pass.")
@click.option("--mask", metavar="ANGLE", help="Lowest elevation of passes, such as 10deg.  [default: that of the station]")
@click.option("--stations", metavar="FILE", multiple=True, help="Stations: SINEX, TOML, ilrs, mpc.  [default: ilrs]")
@click.option("--frequency", metavar="FREQUENCY", help="That the satellite sends at, such as 145.9MHz.")
@click.option(
    "--angles", type=click.Choice(["astrometric", "geocentric", "apparent"]), default="astrometric", show_default=True,
    help="Right ascension and declination against stars, without aberration, or with it.",
)  # fmt: skip
@click.option("--axes", metavar="FRAME", default="GCRF", show_default=True, help="Of right ascension and declination.")
@click.option(
    "--forces", metavar="FORCES", help="Of an orbit given by one state, as determine takes them.  [default: by height]"
)
@click.option(
    "--about", type=click.Choice(["earth", "sun"]), default="earth", show_default=True,
    help="What elements or a state as text go about.",
)  # fmt: skip
@click.option("--object", "chosen", metavar="NAME", help="Object in files of several.")
@options.output("Write .csv, .nc, or positions as .cpf.")
@options.as_json
def command(
    orbit: str,
    station: str,
    when: str,
    step: str,
    passes: bool,
    mask: str | None,
    stations: tuple[str, ...],
    frequency: str | None,
    angles: str,
    axes: str,
    forces: str | None,
    about: str,
    chosen: str | None,
    output_file: str | None,
    as_json: bool,
) -> int:
    """Show where and when ORBIT is seen from a station.

    ORBIT is a determination (.json, .nc), a file (OEM, OPM, OCM, SP3, CPF,
    two-line elements, OMM), elements or a state as text. Rows are dated at the reception:
    right ascension and declination, azimuth and elevation without refraction,
    range, range-rate, motion on the sky, elevation of the Sun, shadow, and where
    the orbit has a covariance the ellipse of three sigma on the sky and the sigma
    along the track in seconds. Of an orbit about the Sun the elongation from it
    stands in the place of shadow.

    Examples:
      piazzi ephemeris orbit.json --from 7090 --when tonight --passes
      piazzi ephemeris iss.tle --from "lat=50.1deg lon=8.6deg height=100m"
      piazzi ephemeris ceres.json --from "lat=38.1deg lon=13.4deg" --step 1d
        --when "1801-12-01T00:00:00 UT1 .. +31d"
      piazzi ephemeris next.oem --from 7825 --step 5min -o next.cpf
        --when "2026-11-03T00:00:00Z .. +1d"
    """
    output.check_output(output_file, ENDINGS)
    from piazzi.determination.ephemerides import ephemeris
    from piazzi.determination.words import quantity

    found = ephemeris(
        orbit, station, when, step=step, passes=passes, stations=list(stations) or None,
        mask=None if mask is None else quantity(mask, "deg", "--mask"),
        frequency=None if frequency is None else quantity(frequency, "Hz", "--frequency"),
        angles=angles, axes=axes, object=chosen, forces=forces, about=about,
    )  # fmt: skip
    if output_file is not None:
        found.write(output_file)
    if as_json:
        output.print_json(found.to_dict())
    else:
        output.print_rich(found, *([f"Wrote {output_file}"] if output_file else []))
    return DONE
