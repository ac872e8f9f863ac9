"""Sections by name, in the order in which they run; each module has ``figures()``, and imports what it needs when it runs."""

SECTIONS = {
    "ekf": "extended Kalman filter beside the C floor",
    "graph": "full factor graph beside the C floor",
    "window": "sliding windows beside the C floor",
    "sizes": "problems of 6 and 18 values with lanes and without",
    "solve": "one linear solve, and one optimisation, beside GTSAM",
    "family": "unscented and square-root filters and the smoother beside the EKF, by time and by operations",
    "filterpy": "extended and unscented Kalman filters beside filterpy",
    "with_jax": "a thousand EKF runs beside dynamax and cuthbert",
    "start_up": "whole processes: warm, cold, help, import",
    "study": "many runs in lanes beside the C floor, and a study of 10,000 runs: time, memory, second core",
    "live": "one measurement at a time",
    "space": "orbits about the Earth beside the C floor: field, tables, steps, days with transition matrix",
    "determine": "a day of low orbit, three radars, 2000 ranges: iterations beside the C floor, whole processes, kernels",
    "files": "files of a million measurements",
    "length": "time per epoch and memory against the number of epochs",
}
