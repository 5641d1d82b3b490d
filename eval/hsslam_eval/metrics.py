"""Metrics of trajectories: relations, absolute error, relative error."""

from hsslam_eval.relations_metric import RelationErrors, fill_in, relations_errors
from hsslam_eval.trajectory_metrics import AteResult, RpeResult, align_rigid, ate, rpe

__all__ = [
    "AteResult",
    "RelationErrors",
    "RpeResult",
    "align_rigid",
    "ate",
    "fill_in",
    "relations_errors",
    "rpe",
]
