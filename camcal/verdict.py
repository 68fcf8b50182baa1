"""What is said of a calibration in the end: one word, and the findings that decide it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

WORDS = ("rejected", "poor", "usable", "good")
"""The words of a verdict, worst first."""

LEVELS = (*WORDS[:-1], "note")
"""The levels of a finding: the best word that a calibration can still get with it; a note leaves any."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing found about a calibration.

    Attributes
    ----------
    code : str
        Short name for programs, such as `fronto_parallel`.
    level : str
        One of `LEVELS`.
    weight : float
        Order among findings of one level, larger first.
    text : str
        What was found, with figures: a clause without a full stop.
    advice : str
        What to do: a sentence.
    """

    code: str
    level: str
    weight: float
    text: str
    advice: str

    def __post_init__(self) -> None:
        if self.level not in LEVELS:
            raise ValueError(f"level: unknown (got {self.level!r}, expected one of {', '.join(LEVELS)})")

    def __str__(self) -> str:
        """Both as sentences."""
        return f"{self.text}. {self.advice}"


@dataclass(frozen=True, slots=True)
class Verdict:
    """How far a calibration can be trusted.

    Attributes
    ----------
    findings : tuple of Finding
        In order of weight: the worst level first.
    """

    findings: tuple[Finding, ...] = ()

    @classmethod
    def of(cls, findings: Iterable[Finding]) -> Verdict:
        """Put findings in their order; of two with one code the heavier stays."""
        ordered = sorted(findings, key=lambda finding: (LEVELS.index(finding.level), -finding.weight))
        first = {finding.code: finding for finding in reversed(ordered)}
        return cls(tuple(finding for finding in ordered if first[finding.code] is finding))

    @property
    def word(self) -> str:
        """`rejected`, `poor`, `usable` or `good`: the worst level of any finding."""
        worst = min((LEVELS.index(finding.level) for finding in self.findings), default=len(WORDS) - 1)
        return WORDS[worst]

    @property
    def problems(self) -> tuple[str, ...]:
        """Why the calibration must not be trusted; empty unless it is rejected."""
        return tuple(str(finding) for finding in self.findings if finding.level == "rejected")

    def reaches(self, word: str) -> bool:
        """Tell whether the verdict is at least as good as a word."""
        return WORDS.index(self.word) >= WORDS.index(word)
