"""Studies: many runs of many settings, on one machine or a cluster, and nothing lost."""

from piazzi.study.execute import Study, kept_runs, run_study
from piazzi.study.store import Stored, Summary, read_store, same_results
from piazzi.study.summary import Line

__all__ = ["Line", "Stored", "Study", "Summary", "kept_runs", "read_store", "run_study", "same_results"]
