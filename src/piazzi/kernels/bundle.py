"""The arrays of a run in named bundles: Python makes them by name, kernels read their members, and a call is checked once.

A bundle lists its members with their sizes: `float` and `int` for one number, ``"int K"`` for one that is K; names of sizes for
an array of float64 (``"K N N"``, K matrices of N rows), after ``int64`` one of integers; ``K+1`` is one more than K, ``*`` any
size.  An entry of a kernel takes bundles; its object code takes their members, one pointer each (`entries.opened`).
"""

from __future__ import annotations

from piazzi.kernels.members import Bundle


class Run(
    Bundle,
    epochs="int K",
    t_prior="float",
    t="K",
    count="int64 K",
    scale="K",
    first_row="int64 K+1",
    Q="N N",
):
    """Epochs of a run: times, substeps and noise scale of the interval before each, where its rows begin; process noise."""


class Given(Bundle, parameters="P", manoeuvres="*", data="*"):
    """What a model is told: values of its parameters; how many manoeuvres, then time, jump and covariance of each.

    `data` of functions from outside: where those of each begin, then these.
    """


class Beside(Bundle, parameters="P", manoeuvres="*", data="*", sides="*", work="*"):
    """What a model is told, with the side of each event that the orbit is on, 1 or -1, and work space.

    The work space has values and rates of all events at the start of a step, at its end, and in between.
    """


class Measured(Bundle, z="J M", station="int64 J", sensor="int64 S", numbers="S U", R="S M M", correlated="int64 S"):
    """Rows of measurements and who made them; sensor, numbers, noise of each station, and whether that is correlated."""


class Belief(Bundle, mean="N", covariance="N N"):
    """A belief about one state: a prior, a prediction, or where an estimate stands."""


class Beliefs(Bundle, mean="K N", covariance="K N N"):
    """Beliefs at all epochs, which a kernel writes."""


class Innovations(Bundle, nu="J M", S="J M M"):
    """Innovations of all rows with their covariances, which a kernel writes."""


class Row(Bundle, nu="M", H="M N", work="W"):
    """Work space for one row: innovation, Jacobian, and the factors of an update."""


class Gate(Bundle, iterations="int", limits="M+1", streak="int64 1", rejected="int64 J"):
    """How an epoch is taken in: Gauss-Newton steps, largest nu^T S^-1 nu by number of components, and who was beyond it.

    `rejected` is 1 for a row that was left out, 2 for one that was beyond the gate and taken because it was open.
    """


class Chain(
    Bundle,
    x="X N",
    f="C N",
    Phi="C N N",
    Q_all="L N N",
    nu="B M",
    H="B M N",
    d_pred="C N",
    P_pred="C N N",
    gains="A N+1",
    multiplier="C N",
    dx="C N",
    scaling="N N",
    loss="*",
    weights="*",
):
    """States `x`, a stretch of them linearised, counted from its first: where each goes, with its derivative and noise; rows.

    Of a solution: predicted deviations and covariances, gains of one epoch, multipliers of the dynamics, deviations.  `scaling`
    has rows of one prior sigma, for damping; `loss` its kind and squared constants by number of components, `weights` of rows.
    """


class Window(Bundle, iterations="int", m="N", P="N N", delayed="X N N", newest="N N"):
    """A sliding window: prior of its oldest state, covariances of states as they leave it, covariance of the newest."""


class Smoothed(Bundle, mean="K N", covariance="K N N", keep_cross="int", cross="D N N"):
    """Smoothed beliefs, which a kernel writes, with covariances of each state and the next where wanted."""


class Factor(Bundle, L="N N", D="N"):
    """Work space: Q = L D L^T with unit L."""


class Report(
    Bundle,
    measurement="O",
    dynamics="O",
    prior="O",
    defect="O",
    gradient="O",
    fit="O",
    step="O",
    step_smoothed="O",
    widest="O",
):
    """One number each: sums of squares, the largest defect without noise; of a step, its gradient, fit and size in sigmas."""


class Border(
    Bundle,
    constants="int",
    root="N N",
    offset="E",
    sigma="E",
    A="C N N",
    B="C E N",
    G="J M E",
    R="Z Z",
    y="Z",
    S="Z N",
    row="Z",
    inverse="Z Z",
    W="Z Z",
    own="N N",
):
    """Unknowns beside a chain: root of the first state's prior, and of the constants their offset and sigma.

    `A`, `B` and `G` are derivatives of the dynamics by the state and by the constants, and of rows by these.  Then the triangle
    R b = y of the unknowns, what a state depends on them, its inverse, and work space.
    """


class Whole(Bundle, mean="K Z", covariance="K Z Z", unknowns="Z", widest="O"):
    """Predicted deviations of states and constants together with their covariances; the unknowns' solution."""


class RootForm(Bundle, mean="N", U="N N", eta="float", share="float", points="L N", rows="T N"):
    """A belief as N rows r_i with P = sum of r_i^T r_i, which a kernel replaces by the last; how it is carried.

    Sigma points x +- eta r_i, and the share of the sum of their even parts that each of these gets; without points both are
    zero.  Work space for points, and for rows to be triangularised.
    """


class JointRoot(Bundle, d="A", B="A A", phi="A", G="M A", centre="M", shifted="M"):
    """An epoch in unknowns of unit variance: correction, joint root, and work space for one row.

    `phi` is B^T times a component's sensitivities, `G` those of all components; `centre` is h at the central point, `shifted`
    the measurement less what curvature adds to its mean.
    """


class Observation(Bundle, states="K N", innovations="J M", rows="J M N"):
    """What measurements say about the first state: states about which they are predicted, which a kernel may follow.

    Whitened innovations, and minus their derivatives by the first state: rows of a root of its Fisher information.
    """


class Noiseless(Bundle, states="K N", z="J M"):
    """States, and measurements of them without noise, which a kernel writes."""


class Stations(
    Bundle,
    station="int64 J",
    sensor="int64 S",
    width="int64 S",
    angle="int64 S M",
    numbers="S U",
    R="S M M",
    W="S M M",
    correlated="int64 S",
):
    """Who measures in each row of all runs of a study; sensor, components, which are angles, and numbers of each station.

    Its noise R, the inverse W of R's Cholesky factor, and whether R is correlated.
    """


class Drawn(Bundle, first="runs N", w="runs K N", v="runs J M", Q_root="N N", R_root="S M M"):
    """First states of runs, standard normal numbers, and roots of the noises that these become."""


class Samples(Bundle, many="int runs", rows="int J", truth="runs K N", z="runs J M"):
    """How many runs there are, rows of measurements in each; their true states and measurements."""


class Ends(Bundle, mean="runs N", covariance="runs N N"):
    """Beliefs of runs at the last epoch, which a kernel writes."""


class Accuracy(
    Bundle,
    groups="int G",
    member="int64 G N",
    squared="runs G K",
    spread="runs G K",
    nees="runs K",
    nis="runs J",
    lowest="runs",
):
    """Groups of states and who is a member; squared errors of groups and what the covariances give them, NEES, NIS.

    `lowest` is the smallest pivot of a correlation matrix on the way.  A kernel writes all but the groups.
    """


class Errors(Bundle, e="*", P="*", variance="*"):
    """Work space for the errors of `LANES` runs: errors, covariances, and their diagonals."""


class Orbit(
    Bundle,
    epochs="int K",
    size="int Z",
    width="int V",
    first_row="int64 K+1",
    W="K Z Z",
    drift="K Z",
    nu="J V",
    H="J V Z",
    root="Z Z",
    start="Z",
    scaling="Z",
):
    """States of one orbit by its first: derivatives `W`, how far they are off it, their rows; root of the first one's prior.

    `start` is the prior's mean less the first state, `scaling` one over the prior sigmas, for damping.
    """


class Shot(
    Bundle,
    mean="K Z",
    covariance="K Z Z",
    dx="K Z",
    inverse="Z Z",
    R="Z Z",
    y="Z",
    b="Z",
    A="Z Z",
    U="Z Z",
    offset="Z",
    row="Z",
):
    """What rows tell of one orbit: predictions with covariances, deviations; triangle R b = y, its inverse; work space."""
