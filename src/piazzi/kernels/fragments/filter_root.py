"""A filter that carries a root of its covariance, over a whole run or one epoch."""

from piazzi.kernels.fragments.root import begin_epoch, finish_epoch, record_root, update_root_row
from piazzi.kernels.fragments.root_linear import advance_root, innovate_root
from piazzi.kernels.fragments.semidefinite import root_of
from piazzi.kernels.fragments.triangle import covariance_of
from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def begin_root(prior: Belief, root: RootForm) -> None:
    store(root.mean, 0, load_vector(prior.mean, 0, N))
    root_of(load_matrix(prior.covariance, 0, N, N), root.U, 0)


@entry
def run_root_filter(
    run: Run,
    p: Given,
    measured: Measured,
    root: RootForm,
    joint: JointRoot,
    gate: Gate,
    beliefs: Beliefs,
    innovations: Innovations,
) -> None:
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    x = load_vector(root.mean, 0, N)
    Q = load_matrix(run.Q, 0, N, N)
    before = run.t_prior
    for k in range(run.epochs):
        if run.t[k] > before:
            x = advance_root(run, k, before, x, p, Q, root)
        before = run.t[k]
        begin_epoch(joint)
        for row in range(run.first_row[k], run.first_row[k + 1]):
            innovate_root(measured, row, run.t[k], x, p, root, own, joint)
            record_root(row, measured, own, joint, innovations)
            squared, present = squared_innovation(row, innovations, own.work)
            if passes_gate(row, squared, present, gate, innovations):
                update_root_row(row, measured, own, joint)
        x = finish_epoch(x, root, joint)
        store(beliefs.mean, k * N, x)
        store(beliefs.covariance, k * N * N, covariance_of(root.U))
    store(root.mean, 0, x)
