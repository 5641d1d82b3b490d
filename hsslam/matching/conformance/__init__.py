"""Does a matcher keep the promises of the interface? For its author's own test suite.

All at once::

    from hsslam.matching.conformance import check_matcher

    def test_mine() -> None:
        check_matcher(Mine)

or one test per promise, with pytest::

    @parametrize_with_checks([Mine, "hide"])
    def test_promise(matcher, check) -> None:
        check(matcher)
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import Any, TypeAlias

from hsslam.matching import registry
from hsslam.matching.conformance import answers, form, inputs
from hsslam.matching.interface import Matcher

__all__ = ["Check", "check_matcher", "conformance_checks", "parametrize_with_checks"]

Check: TypeAlias = Callable[[Matcher[Any]], None]
"""Raises AssertionError where the matcher breaks the promise."""

_CHECKS: tuple[Check, ...] = (
    form.check_config,
    form.check_summary,
    form.check_pickle,
    form.check_result_types,
    answers.check_score,
    answers.check_covariance,
    answers.check_accuracy,
    answers.check_theta_range,
    answers.check_frame_invariance,
    answers.check_window,
    answers.check_determinism,
    answers.check_threads,
    answers.check_many,
    answers.check_extend,
    inputs.check_inputs_untouched,
    inputs.check_array_layouts,
    inputs.check_not_finite_rows,
    inputs.check_too_few_points,
    inputs.check_degenerate_points,
    inputs.check_wrong_shapes,
)


def check_matcher(matcher: Matcher[Any] | type[Matcher[Any]] | str, *, exempt: Collection[str] = ()) -> None:
    """Run every check on a matcher.

    Parameters
    ----------
    matcher : Matcher, class of one, or str
        An instance; a class, made with its default config; or a registered name.
    exempt : collection of str
        Names of checks (see `conformance_checks`) to leave out: a known weakness, stated in the open.

    Raises
    ------
    AssertionError
        One line per promise that the matcher breaks.
    ValueError
        ``exempt`` names no check.
    """
    checks = conformance_checks()
    unknown = set(exempt) - {name for name, _ in checks}
    if unknown:
        raise ValueError(f"no conformance check is named {', '.join(sorted(unknown))}")
    subject = _instance(matcher)
    failures = []
    for name, check in checks:
        if name in exempt:
            continue
        try:
            check(subject)
        except AssertionError as error:
            failures.append(f"{name}: {error}")
        except Exception as error:
            failures.append(f"{name}: raised {type(error).__name__}: {error}")
    if failures:
        raise AssertionError(
            f"{type(subject).__name__} fails {len(failures)} conformance check(s):\n" + "\n".join(failures)
        )


def conformance_checks() -> list[tuple[str, Check]]:
    """Every check by name; each takes a matcher and raises AssertionError."""
    return [(check.__name__.removeprefix("check_"), check) for check in _CHECKS]


def parametrize_with_checks(matchers: Iterable[Matcher[Any] | type[Matcher[Any]] | str]) -> Any:
    """Decorate a pytest function of ``(matcher, check)``: one test per matcher and check."""
    import pytest

    cases = [
        pytest.param(subject, check, id=f"{_label(matcher)}-{name}")
        for matcher in matchers
        for subject in [_instance(matcher)]
        for name, check in conformance_checks()
    ]
    return pytest.mark.parametrize(("matcher", "check"), cases)


def _instance(matcher: Matcher[Any] | type[Matcher[Any]] | str) -> Matcher[Any]:
    if isinstance(matcher, str):
        return registry.create(matcher)
    return matcher() if isinstance(matcher, type) else matcher


def _label(matcher: Matcher[Any] | type[Matcher[Any]] | str) -> str:
    if isinstance(matcher, str):
        return matcher
    return matcher.__name__ if isinstance(matcher, type) else type(matcher).__name__
