"""Options of the methods of `hsslam.search.minimize`, with the paper's figures as defaults."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

PAPER_RANGE = 30.0
"""Width of the paper's window (cm): its bandwidths, 8 and 0.2 cm, become shares of a range by it."""

PAPER_PITCH_ADJUSTING_RATES = (0.55, 0.98)
PAPER_BANDWIDTHS = (0.2 / PAPER_RANGE, 8.0 / PAPER_RANGE)


class Options(BaseModel):
    """What every method takes."""

    model_config: ClassVar[ConfigDict] = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class HarmonyMemory(Options):
    """A harmony memory and how much of a harmony comes from it."""

    memory_size: int = Field(default=30, ge=4, description="harmonies in the memory (HMS)")
    memory_considering_rate: float = Field(
        default=0.88, ge=0.0, le=1.0, description="probability that a variable comes from the memory (HMCR)"
    )


class Harmony(HarmonyMemory):
    """Classic harmony search; the paper tunes the varying kind only.

    So the defaults are what that has half way: the mean of PAR_min and PAR_max, and the geometric mean of BW_min
    and BW_max (equations 2 and 3 at t = NI / 2).
    """

    pitch_adjusting_rate: float = Field(
        default=sum(PAPER_PITCH_ADJUSTING_RATES) / 2.0,
        ge=0.0,
        le=1.0,
        description="probability of adjustment (PAR)",
    )
    bandwidth: float = Field(
        default=(PAPER_BANDWIDTHS[0] * PAPER_BANDWIDTHS[1]) ** 0.5,
        gt=0.0,
        description="largest pitch adjustment, as a share of the variable's range (BW)",
    )


class ImprovedHarmony(HarmonyMemory):
    """Improved harmony search: PAR rises and BW falls over the budget (equations 2 and 3).

    The paper's bandwidths, 8 to 0.2 cm, belong to a window of +-15 cm, so as shares of a range they are 0.267 and
    0.0067. That resolution suits a scan; a minimum wanted to many digits asks for a far smaller ``bandwidth_min``.
    """

    pitch_adjusting_rate_min: float = Field(
        default=PAPER_PITCH_ADJUSTING_RATES[0], ge=0.0, le=1.0, description="PAR at the start (PAR_min)"
    )
    pitch_adjusting_rate_max: float = Field(
        default=PAPER_PITCH_ADJUSTING_RATES[1], ge=0.0, le=1.0, description="PAR at the end (PAR_max)"
    )
    bandwidth_min: float = Field(
        default=PAPER_BANDWIDTHS[0], gt=0.0, description="BW at the end, as a share of the range (BW_min)"
    )
    bandwidth_max: float = Field(
        default=PAPER_BANDWIDTHS[1], gt=0.0, description="BW at the start, as a share of the range (BW_max)"
    )

    @model_validator(mode="after")
    def _ordered(self) -> ImprovedHarmony:
        if self.bandwidth_min > self.bandwidth_max:
            raise ValueError("bandwidth_min is larger than bandwidth_max")
        return self


class Evolution(Options):
    """What both schemes of differential evolution take.

    The paper prints F for HIDE alone, and no crossover rate at all: the usual 0.9 stands in.
    """

    population_size: int = Field(default=30, ge=4, description="members; as many as the paper's HMS")
    weight: float = Field(
        default=0.44, ge=0.0, le=2.0, description="weight of the difference of two members (F)"
    )
    crossover_rate: float = Field(
        default=0.9,
        ge=0.0,
        le=1.0,
        description="share of variables taken from the mutant (the paper gives none)",
    )


class SimpleEvolution(Evolution):
    """Simple differential evolution (equation 11), which multiplies the target itself by L.

    The paper gives L no value. Any but 1 pulls every member towards the origin of the coordinates, wherever the
    box lies, which would find minima at the origin for a wrong reason; with 1 the scheme is DE/current/1.
    """

    base_factor: float = Field(default=1.0, description="what the target is multiplied by (L)")


class BestEvolution(Evolution):
    """DE/rand-to-best/1 (equation 12)."""

    attraction: float = Field(
        default=0.7, ge=0.0, le=2.0, description="pull towards the best member (lambda)"
    )


class Hide(ImprovedHarmony):
    """HIDE: ``harmony_run`` improvisations, then equation 12 on every harmony, and so on (paper, section 5.2)."""

    harmony_run: int = Field(
        default=14, ge=0, description="improvisations between two differential steps (HRT)"
    )
    attraction: float = Field(
        default=0.7, ge=0.0, le=2.0, description="pull towards the best harmony (lambda)"
    )
    weight: float = Field(
        default=0.44, ge=0.0, le=2.0, description="weight of the difference of two harmonies (F)"
    )
    crossover_rate: float = Field(
        default=0.9,
        ge=0.0,
        le=1.0,
        description="share of variables taken from the mutant (the paper gives none)",
    )


class Genetic(Options):
    """A genetic algorithm; population and rates as the authors of GLASM published them.

    ``gray`` is GLASM's: a chromosome of Gray-coded variables, one-point crossover, one bit of a child flips.
    ``real`` is its counterpart on real numbers: blend crossover (BLX-0.5, Eshelman and Schaffer 1993), one variable
    of a child moves by a Gaussian. GLASM's authors have 9 bits and give no selection.
    """

    population_size: int = Field(default=120, ge=2, description="chromosomes in a generation")
    encoding: Literal["gray", "real"] = Field(
        default="gray", description="Gray-coded bits, or the numbers themselves"
    )
    bits: int = Field(default=16, ge=2, le=48, description="`gray`: bits of a variable")
    crossover_rate: float = Field(
        default=1.0, ge=0.0, le=1.0, description="probability that a child has two parents"
    )
    mutation_rate: float = Field(default=0.12, ge=0.0, le=1.0, description="probability that a child mutates")
    mutation_scale: float = Field(
        default=0.1, gt=0.0, description="`real`: standard deviation of a mutation, as a share of the range"
    )
    tournament: int = Field(default=3, ge=1, description="contestants for each parent")
