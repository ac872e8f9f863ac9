"""``piazzi propagate``: an orbit at other times, without measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from piazzi.cli import options, output
from piazzi.cli.running import DONE, NOT_ESTIMATED

if TYPE_CHECKING:
    from piazzi.cli.courses import Course

ENDINGS = (".oem", ".nc", ".csv")


@click.command(cls=options.Command)
@click.argument("orbit", metavar="ORBIT")
@click.option("--forces", metavar="FORCES", help="default, none, a .toml with [earth], or NAME=VALUE ...  [default: by height]")
@click.option("--from", "begin", metavar="DATE", help="Where to begin.  [default: the orbit's own date]")
@click.option("--to", "end", metavar="DATE", help="Date with its scale, or a time such as 3d.  [default: 1 day]")
@click.option("--step", metavar="TIME", help="Between states: seconds, or such as 10min.  [default: 60 s]")
@click.option("--frame", metavar="FRAME", default="GCRF", show_default=True, help="Frame of the output.")
@click.option("--object", "chosen", metavar="NAME", help="Object in files of several, by name or identifier.")
@options.output("Write states and covariances as .oem, .nc or .csv.")
@options.as_json
def command(
    orbit: str,
    forces: str | None,
    begin: str | None,
    end: str | None,
    step: str | None,
    frame: str,
    chosen: str | None,
    output_file: str | None,
    as_json: bool,
) -> int:
    """Propagate ORBIT to other times, with its covariance.

    ORBIT is a determination (.json, .nc), a file (OEM, OPM, OCM, SP3, CPF, TLE, OMM) or a scenario. Of several states the last
    with a covariance is taken, or the one nearest to --from. Forces are chosen by the orbit's height and said, unless --forces
    names them: words such as "gravity=EGM2008 degree=40 drag=exponential cd_a_m=0.02", behind "default" where they change that.
    A determination has its own.
    A scenario has forces, process noise and a prior of its own.

    Examples:
      piazzi propagate old.oem --to 3d -o new.oem
      piazzi propagate iss.tle --to "2026-11-05 UTC" --frame ITRF -o iss.csv
      piazzi propagate state.opm --forces "degree=40 tides=none" --json
    """
    output.check_output(output_file, ENDINGS)
    from piazzi.cli.courses import course_of, span_of
    from piazzi.earth.rotation import frame_named

    frame_named(frame)
    course = course_of(orbit, forces, begin, chosen)
    if (output_file or "").lower().endswith(".oem") and not course.dated:
        raise ValueError(
            "an OEM holds orbits: states x, y, z, vx, vy, vz with dates; this scenario has others, write .csv or .nc"
        )
    times = span_of(course, begin, end, step)
    found = course.at(times)
    if output_file is not None:
        _write(output_file, course, found, frame)
    told = to_dict(course, found, frame)
    if as_json:
        output.print_json(told)
    else:
        from piazzi.present.propagated import Propagated

        wrote = [f"Wrote {output_file}"] if output_file else []
        output.print_rich(Propagated(told), *wrote)
    return DONE if found.success else NOT_ESTIMATED


def to_dict(course: Course, found: Any, frame: str) -> dict[str, Any]:
    """What was propagated, in numbers: first and last state, with forces and assumptions."""
    from piazzi.evaluate.quantities import finite
    from piazzi.orbit.predicted import sigma_in_orbit

    problem, names = course.problem, list(found.names)
    orbit = None
    if course.is_orbit and course.uncertain:
        x = [names.index(name) for name in ("x", "y", "z", "vx", "vy", "vz")]
        orbit = sigma_in_orbit(found.mean[:, x], found.covariance[:, x][:, :, x])

    def at(k: int) -> dict[str, Any]:
        t = float(found.times[k])
        out: dict[str, Any] = {"t": t, "mean": found.mean[k].tolist()}
        if problem.epoch is not None:
            out = {"epoch": str(problem.epoch + t), **out}
        if course.uncertain:
            out["sigma"] = list(map(finite, found.sigma[k]))
        if orbit is not None:
            out["sigma_rtn"] = orbit[k].tolist()
        return out

    return {
        "schema": "piazzi.propagate/1",
        "object": course.name,
        "source": course.source,
        "epoch": None if problem.epoch is None else str(problem.epoch),
        "states": "GCRF" if course.is_orbit else None,
        "written": frame,
        "names": names,
        "units": [problem.model.unit(name) for name in names],
        "forces": course.forces,
        "assumed": list(course.assumed),
        "count": len(found.times),
        "first": at(0),
        "last": at(-1),
        "success": found.success,
        "message": found.message,
    }


def _write(path: str, course: Course, found: Any, frame: str) -> None:
    if path.lower().endswith(".nc"):
        from piazzi.io.netcdf import write_dataset

        write_dataset(path, found.to_dataset())
        return
    if path.lower().endswith(".csv") and not course.dated:
        names = found.names
        rows = zip(found.times.tolist(), found.mean.tolist(), found.sigma.tolist(), strict=True)
        sigma = tuple(f"{name}_sigma" for name in names) if course.uncertain else ()
        output.write_csv(
            path, [{"time": t, **dict(zip(names, m, strict=True)), **dict(zip(sigma, s, strict=False))} for t, m, s in rows]
        )
        return
    ephemeris = course.ephemeris(found, frame)
    if path.lower().endswith(".csv"):
        output.write_csv(path, list(_rows(ephemeris.arcs[0])))
        return
    from piazzi.formats.write_odm import oem_text
    from piazzi.io.atomic import atomic_path

    with atomic_path(path) as work:
        work.write_text(oem_text(ephemeris), encoding="utf-8")


def _rows(arc: Any) -> Any:
    """States of an arc with dates, m and m/s, and standard deviations where there are covariances."""
    import numpy as np

    from piazzi.formats.writing import dates

    names = ("x", "y", "z", "vx", "vy", "vz")
    sigma = np.sqrt(np.maximum(np.diagonal(arc.covariance, axis1=1, axis2=2), 0.0)) if len(arc.covariance) else None
    for k, date in enumerate(dates(arc.scale, arc.epoch, arc.t)):
        state = [*arc.position[k].tolist(), *arc.velocity[k].tolist()]
        row = {"time": f"{date} {arc.scale}", "frame": arc.frame, **dict(zip(names, state, strict=True))}
        if sigma is not None:
            row |= {f"{name}_sigma": s for name, s in zip(names, sigma[k].tolist(), strict=True)}
        yield row
