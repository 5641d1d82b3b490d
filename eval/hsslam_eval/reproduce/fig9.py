"""Figure 9: what noise of the sensor does to HSL and HIDE."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hsslam_eval.protocols import TrialPair
from hsslam_eval.reproduce import drawing, methods
from hsslam_eval.reproduce.data import (
    PairSet,
    add_noise,
    is_simulated,
    pair_sets,
    trial_config,
)
from hsslam_eval.reproduce.duel import strict_success
from hsslam_eval.reproduce.experiment import Claim, Drawing, Experiment, Request, Row, Table, Tell, Value
from hsslam_eval.reproduce.findings import Findings
from hsslam_eval.reproduce.judge import no_worse, paired
from hsslam_eval.statistics import bootstrap_interval, wilson_interval
from hsslam_eval.trials import TrialResult, run_trials

NOISE = (0.0, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12)
"""Standard deviations of the noise along the beams of both scans (m)."""

JUDGED = 0.05
"""The claim is judged at this noise (m): over twice what the laser's maker states within 2 m."""

Results = dict[tuple[str, float], TrialResult]


def run(request: Request, tell: Tell) -> Experiment:
    """Redo Figure 9; see `hsslam_eval.reproduce`."""
    count = request.count(500, 40)
    contestants = [methods.published("hsl"), methods.published("hide"), methods.ours("hide")]
    found = Findings(request)
    remarks: list[str] = []
    for pairs in pair_sets(request, count, noiseless=True):
        results: Results = {}
        config = trial_config(request, count)
        for noise in NOISE:
            noisy = _noisy(pairs.pairs, noise, request.seed)
            for method in contestants:
                label = f"{method.label}, {100 * noise:.0f} cm of noise, {pairs.key}"
                results[method.label, noise] = run_trials(
                    method.label,
                    method.matcher,
                    noisy,
                    config,
                    lambda done, of, label=label: tell(label, done, of),  # type: ignore[misc]
                )
        labels = [method.label for method in contestants]
        found.tables += [_errors(results, labels, pairs, request.seed), _successes(results, labels, pairs)]
        found.drawings.append(_draw(results, labels, pairs, request.seed))
        found.claims += [_graceful(results, label, pairs.key) for label in ("HSL", "HIDE")]
        remarks += [_dip(results, label, pairs.key) for label in ("HSL", "HIDE")]
    return found.experiment(
        "fig9",
        "Figure 9: noise of the sensor",
        summary="HSL and HIDE as published, and hide as hsslam ships it, on the same pairs of scans with more and more "
        "Gaussian noise along the beams of both scans, L = 30 cm. "
        + (
            "The simulated laser is otherwise free of noise, so the axis is all the noise there is."
            if is_simulated(request)
            else "The noise comes on top of the laser's own."
        ),
        counts={"trials per method and noise": count},
        config={"noise_m": list(NOISE), **{each.label: each.described() for each in contestants}},
        notes=(
            "The paper says neither what noise it adds nor how much, and prints no figures beside the plot.",
            "That a method handles a high level of noise is made precise by us: the mean error over all trials grows "
            f"by less than half of the noise that is added, at {100 * JUDGED:.0f} cm.",
            *filter(None, remarks),
        ),
    )


def _noisy(pairs: list[TrialPair], noise: float, seed: int) -> list[TrialPair]:
    found = []
    for trial, pair in enumerate(pairs):
        # The same draws at every level, so that levels differ by their size alone.
        rng = np.random.default_rng([seed, trial, 0x9])
        reference = add_noise(pair.reference_points, noise, rng)
        found.append(
            replace(pair, reference_points=reference, scan_points=add_noise(pair.scan_points, noise, rng))
        )
    return found


def _headings() -> tuple[str, ...]:
    return tuple(f"noise {100 * noise:.0f} cm" for noise in NOISE)


def _displacements(results: Results, label: str, seed: int) -> tuple[Value, ...]:
    return tuple(
        Value.of(bootstrap_interval(results[label, noise].displacement, seed=seed), 100.0) for noise in NOISE
    )


def _ratios(results: Results, label: str) -> tuple[Value, ...]:
    good = [strict_success(results[label, noise]) for noise in NOISE]
    return tuple(Value.of(wilson_interval(int(each.sum()), len(each)), 100.0) for each in good)


def _errors(results: Results, labels: list[str], pairs: PairSet, seed: int) -> Table:
    return Table(
        f"Mean displacement error (cm) by noise: {pairs.label}",
        f"{len(pairs.pairs)} trials each, L = 30 cm, all trials; 95% bootstrap intervals.",
        _headings(),
        tuple(Row(label, _displacements(results, label, seed)) for label in labels),
    )


def _successes(results: Results, labels: list[str], pairs: PairSet) -> Table:
    return Table(
        f"Success ratio (%) by noise: {pairs.label}",
        "Success: under 10 cm and 0.01 rad; 95% Wilson intervals.",
        _headings(),
        tuple(Row(label, _ratios(results, label)) for label in labels),
    )


def _draw(results: Results, labels: list[str], pairs: PairSet, seed: int) -> Drawing:
    figure, (left, right) = drawing.panels(2, width=5.6, height=4.4)
    x = [100.0 * noise for noise in NOISE]
    drawing.with_intervals(left, x, {label: _displacements(results, label, seed) for label in labels}, 0.08)
    drawing.with_intervals(right, x, {label: _ratios(results, label) for label in labels}, 0.08)
    left.set_ylabel("mean displacement error, all trials (cm)")
    left.set_ylim(bottom=0.0)
    right.set_ylabel("success ratio (%), < 10 cm and < 0.01 rad")
    right.set_ylim(0.0, 102.0)
    for axes in (left, right):
        axes.set_xlabel("noise along the beams, standard deviation (cm)")
    drawing.legend_below(figure, left)
    return Drawing(
        f"figure-{pairs.key}",
        f"{pairs.label}: displacement error and success ratio over the noise of the sensor, with 95% intervals.",
        figure,
    )


def _graceful(results: Results, label: str, key: str) -> Claim:
    clean, noisy = results[label, 0.0], results[label, JUDGED]
    change = 100.0 * (strict_success(noisy).mean() - strict_success(clean).mean())
    claim = no_worse(
        f"{key}: {label} handles a high level of sensor noise with little loss.",
        paired(noisy.displacement, clean.displacement),
        0.5 * JUDGED,
        this=f"{label} with {100 * JUDGED:.0f} cm of noise",
        other="without",
        what="mean displacement error",
        unit="cm",
        scale=100.0,
    )
    return replace(
        claim, why=f"{claim.why} Its success ratio (10 cm, 0.01 rad) changes by {change:+.1f} points."
    )


def _dip(results: Results, label: str, key: str) -> str:
    """Say so where some noise makes a method more accurate than none."""
    clean = results[label, 0.0].displacement
    best = min(NOISE, key=lambda noise: float(results[label, noise].displacement.mean()))
    gain = paired(results[label, best].displacement, clean)
    if best == 0.0 or gain.high >= 0.0:
        return ""
    return (
        f"{key}: {label} is most accurate with {100 * best:.0f} cm of noise, by {-100 * gain.value:.2f} cm over none "
        f"(95% interval {-100 * gain.high:.2f} to {-100 * gain.low:.2f}): without noise every point stays in its "
        "square over a range of poses, among which the count of hits cannot choose; noise near the squares' half "
        "side smooths the count."
    )
