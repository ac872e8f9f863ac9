"""Names that a fragment may use and that the generated module around it defines: for readers and type checkers only.

Fragments import from here so that they can be read, linted and checked as ordinary Python; the composer drops the import.
"""

from __future__ import annotations

from typing import Any

from piazzi.kernels.bundle import (  # noqa: F401
    Accuracy,
    Belief,
    Beliefs,
    Beside,
    Border,
    Chain,
    Drawn,
    Ends,
    Errors,
    Factor,
    Gate,
    Given,
    Innovations,
    JointRoot,
    Measured,
    Noiseless,
    Observation,
    Orbit,
    Report,
    RootForm,
    Row,
    Run,
    Samples,
    Shot,
    Smoothed,
    Stations,
    Whole,
    Window,
)
from piazzi.kernels.plain import *  # noqa: F403

ND: int
N: int
M: int
MN: int
NN: int
M_LANES: int
N_LANES: int
MN_LANES: int
NN_LANES: int
WORK: int
NUMBERS: int
LANES: int
LOST: float
FEW_DIGITS: float
REOPENS: int
MAX_STEPS: int
MAX_PANELS: int
RTOL: float
ATOL: float
GROUP: tuple[int, ...]
GAPS: int
GAP: tuple[float, ...]
NODE: tuple[float, ...]
WEIGHT: tuple[float, ...]
ORDER: int
DRIVEN: int
SLOT: int
TOP: int
HISTORY: int
EVENTS: int
EVENTS_WORK: int
EVENTS_LANES: int


# functions of the language, as far as fragments use them
atan2: Any
exp: Any
fabs: Any
log: Any
sin: Any
sinh: Any
sqrt: Any
# written by generate.py
dynamics: Any
rhs: Any
substep: Any
substep_jacobian: Any
trial: Any
trial_jacobian: Any
panel: Any
orbit_axes: Any
predicted: Any
corrected: Any
between: Any
driven: Any
driven_of: Any
positions: Any
positions_of: Any
doubled: Any
doubled_of: Any
joined: Any
joined_of: Any
dynamics_beside: Any
rhs_beside: Any
events_of: Any
events_into: Any
event_row: Any
jumped: Any
first_rows: Any
identity_rows: Any
remember: Any
complete: Any
measure_into: Any
innovate: Any
measure_row: Any
innovate_row: Any
measure_lanes: Any
innovate_lanes: Any
# written in fragments/arc_*.py, noise_*.py, axes*.py, transition*.py, update_*.py
propagate_arc: Any
propagate_arc_jacobian: Any
propagate_arc_noise: Any
arc_lanes: Any
arc_lanes_jacobian: Any
propagate_noise: Any
begin: Any
side_of: Any
lowest: Any
is_clear: Any
crossing: Any
reach: Any
reach_jacobian: Any
cross: Any
arrive: Any
combined_error: Any
matrix_error: Any
noise_in_axes: Any
resized: Any
manoeuvre: Any
manoeuvre_within: Any
substeps_for: Any
propagate: Any
transition: Any
advance: Any
symmetric: Any
update_row: Any
decorrelate: Any
record: Any
record_variance_ratio: Any
update_epoch: Any
# written in fragments/noise_*.py, linearize.py, chain.py
linearize_dynamics: Any
noise_at: Any
noise_varies: Any
linearize_rows: Any
marginal_covariances: Any
forward: Any
record_epoch: Any
marginalize_oldest: Any
solve_window: Any
forward_fixed_point: Any
cancelled: Any
Q_matrix: Any
back_through_epoch: Any
predict_deviation: Any
backward: Any
update_deviation: Any
squared_innovation: Any
update_epoch_guarded: Any
passes_gate: Any
# written in fragments/rows.py
whiten_row: Any
# written in fragments/graph_linearize.py
weigh_dynamics: Any
# written in fragments/*_lanes.py
propagate_lanes: Any
transition_lanes: Any
transition_each: Any
ones: Any
store_errors: Any
squared_lanes: Any
nees_lanes: Any
# written in fragments/border.py
rotate: Any
solve_triangle: Any
begin_border: Any
advance_border: Any
update_bordered: Any
width_of_row: Any
record_belief: Any
# written in fragments/gauss_jackson_*.py
first_derivative: Any
rate: Any
rate_jacobian: Any
rates_of: Any
stepped: Any
rows_at: Any
keep_rows: Any
driven_rows: Any
position_rows: Any
doubled_rows: Any
joined_rows: Any
begin_derivatives: Any
write_derivative: Any
write_last: Any
# written in fragments/arc_*watched.py
watching: Any
watch_from: Any
may_pass: Any
