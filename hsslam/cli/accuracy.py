"""Accuracy of a trajectory in a few lines; what `run` and `eval` print."""

from __future__ import annotations


def rows(errors: dict[str, dict[str, float]]) -> list[tuple[str, str]]:
    """The lines of a summary of `hsslam_eval.accuracy.measure`, e.g. ``("ATE", "0.0094 m, ...")``."""
    from hsslam_eval.accuracy import RPE_DELTA

    lines = []
    if relations := errors.get("relations"):
        lines.append(
            (
                "relations error",
                f"{relations['translation_mean_m']:.4f} +- {relations['translation_std_m']:.4f} m, "
                f"{relations['rotation_mean_deg']:.3f} +- {relations['rotation_std_deg']:.3f} deg "
                f"(mean +- std of {relations['count']:,.0f})",
            )
        )
    for name, title in (("ate", "ATE"), ("rpe", f"RPE over {RPE_DELTA:g} m")):
        if error := errors.get(name):
            lines.append(
                (
                    title,
                    f"{error['translation_rmse_m']:.4f} m, {error['rotation_rmse_deg']:.3f} deg "
                    f"(rms of {error['count']:,.0f})",
                )
            )
    return lines
