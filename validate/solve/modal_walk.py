"""Steps of q'' + c q' + w^2 q = f for many modes at once: exact ones, and Newmark's rules.

Exact: for a force that is linear within the step, or held at its end value, whatever the step.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.fem.modes import Modes
from validate.solve.newmark_rule import Rule, per_mode


@dataclass(frozen=True)
class Walk:
    """The step of all modes (r,): new q and q' from q, q', q'' and the forces at both ends.

    `q` and `rate` hold one factor (r,) each of q, q', q'', the old and the new force; without
    `rate` the rule gives q' and q''.
    """

    modes: Modes
    q: tuple[Floats, ...]
    rate: tuple[Floats, ...] | None
    rule: Rule | None

    def step(
        self, q: Floats, v: Floats, a: Floats, f_old: Floats, f_new: Floats
    ) -> tuple[Floats, Floats, Floats]:
        given = (q, v, a, f_old, f_new)
        new = _sum(self.q, given)
        if self.rate is None:
            assert self.rule is not None
            return new, *self.rule.rates(new, q, v, a)
        rate = _sum(self.rate, given)
        return new, rate, f_new - self.modes.damping * rate - self.modes.omega**2 * new


def _sum(factors: tuple[Floats, ...], given: tuple[Floats, ...]) -> Floats:
    total = factors[0] * given[0]
    for factor, value in zip(factors[1:], given[1:], strict=True):
        total += factor * value
    return total


def walk_by_rule(modes: Modes, rule: Rule) -> Walk:
    q, v, a, f = per_mode(rule, modes.damping, modes.omega**2)
    # The excitation has weighted the forces of both ends already: one force a step.
    return Walk(modes, (q, v, a, 0 * f, f), None, rule)


def exact_walk(modes: Modes, h: float, force: str) -> Walk:
    """q = p + homogeneous solution from (q - p, q' - p'), p the particular one of f0 + f' t."""
    c, w2 = modes.damping, modes.omega**2
    qq, qv, vq, vv = _homogeneous(c, w2, h)
    still, none = 1 / w2, np.zeros_like(w2)
    if force == "constant":
        return Walk(
            modes, (qq, qv, none, none, still * (1 - qq)), (vq, vv, none, none, -still * vq), None
        )
    lag, rise = c / w2**2 / h, 1 / w2 / h
    # p(0) = f_old/w^2 - lag (f_new - f_old), p(h) = f_new/w^2 - the same, p' = rise (f_new - f_old)
    q_new = still - lag + qq * lag - qv * rise
    q_old = lag - qq * (still + lag) + qv * rise
    v_new = rise + vq * lag - vv * rise
    v_old = -rise - vq * (still + lag) + vv * rise
    return Walk(modes, (qq, qv, none, q_old, q_new), (vq, vv, none, v_old, v_new), None)


def _homogeneous(c: Floats, w2: Floats, h: float) -> tuple[Floats, Floats, Floats, Floats]:
    """q, q' after h from q = 1 and from q' = 1 of q'' + c q' + w2 q = 0, overdamped or not.

    The smaller root is w2 over the larger one: their difference would lose its digits.
    """
    half = np.sqrt((c / 2).astype(complex) ** 2 - w2)
    fast = -c / 2 - half
    slow = w2 / fast
    e_slow, e_fast = np.exp(slow * h), np.exp(fast * h)
    gap = slow - fast
    close = np.abs(gap * h) < 1e-4
    series = h * np.exp(-c * h / 2) * (1 + (gap * h) ** 2 / 24)
    phi = np.where(close, series, (e_slow - e_fast) / np.where(close, 1.0, gap))
    rows = e_fast - fast * phi, phi, -w2 * phi, e_fast + slow * phi
    qq, qv, vq, vv = (np.ascontiguousarray(x.real) for x in rows)
    return qq, qv, vq, vv
