"""What two libraries' times and errors on one work say of each other; pairs are (processor time, error)."""

import numpy as np
from scipy.optimize import brentq

LEAST_SPAN = 2.0
"""Of processor times, for an exponent."""


def error_of(values, reference):
    """The largest relative distance of a row of `values` (n, k) from that of `reference`."""
    values, reference = np.asarray(values, float), np.asarray(reference, float)
    apart = np.linalg.norm(values - reference, axis=1)
    return float(np.max(apart / np.linalg.norm(reference, axis=1)))


def exponent(pairs):
    """Slope of log error over log time by least squares; nan for less than three pairs or times that hardly differ."""
    if len(pairs) < 3 or max(pairs)[0] < LEAST_SPAN * min(pairs)[0]:
        return np.nan
    time, error = np.log(np.array(sorted(pairs))).T
    centred = time - time.mean()
    return float(centred @ error / (centred @ centred))


def useful(pairs):
    """Those that no quicker one beats in error, from quick and rough to slow and fine."""
    kept = []
    for time, error in sorted(pairs):
        if not kept or error < kept[-1][1]:
            kept.append((time, error))
    return kept


def time_at(pairs, error):
    """Time that an error costs: between two runs by their logarithms, else of the quickest that is at least as good."""
    return _between([(e, t) for t, e in useful(pairs)], error)


def error_at(pairs, time):
    """Error that a time buys: between two runs by their logarithms, else of the best that is at least as quick."""
    return _between(useful(pairs), time)


def _between(curve, wanted):
    """Value of a falling curve of (argument, value) at `wanted`; None where all arguments are above it."""
    curve = sorted(curve)
    below = [k for k, (argument, _) in enumerate(curve) if argument <= wanted * (1 + 1e-12)]
    if not below:
        return None
    if below[-1] == len(curve) - 1 or curve[below[-1]][0] == wanted:
        return curve[below[-1]][1]
    (a, v), (b, w) = curve[below[-1]], curve[below[-1] + 1]
    part = np.log(wanted / a) / np.log(b / a)
    return float(v * (w / v) ** part)


def at_equal_error(ours, theirs):
    """The smallest error that both reach, and there the ratio of times, theirs over ours."""
    error = max(min(e for _, e in ours), min(e for _, e in theirs))
    return error, time_at(theirs, error) / time_at(ours, error)


def at_equal_time(ours, theirs):
    """The longest time both take, and the ratio of errors, theirs over ours; 0 or inf: ours or theirs takes longer."""
    time = min(max(t for t, _ in ours), max(t for t, _ in theirs))
    found = error_at(theirs, time), error_at(ours, time)
    return time, np.inf if found[0] is None else 0.0 if found[1] is None else found[0] / found[1]


def best_for_them(ours, theirs):
    """Of their errors that we reach too, the one with the least ratio of times, theirs over ours; and that ratio."""
    least = min(e for _, e in ours)
    ratios = [(t / time_at(ours, max(e, least)), max(e, least)) for t, e in useful(theirs)]
    ratio, error = min(ratios)
    return error, ratio


def limit(sizes, answers):
    """Where answers with a leading error c·size^p go, from the finest three; c a vector, p found from them.

    Returns
    -------
    (limit, p), or None where the answers do not settle like a power of the size
    """
    order = np.argsort(sizes)[:3]
    if len(order) < 3:
        return None
    fine, middle, coarse = (np.asarray(answers[k], float) for k in order)
    a, b, c = (float(sizes[k]) for k in order)
    last = middle - fine
    ratio = np.sum((coarse - middle) * last) / np.sum(last * last)

    def mismatch(power):
        return (c**power - b**power) / (b**power - a**power) - ratio

    if mismatch(0.3) * mismatch(8.0) > 0:
        return None
    power = brentq(mismatch, 0.3, 8.0)
    return fine - last * a**power / (b**power - a**power), float(power)
