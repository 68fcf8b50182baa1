"""What explains what: a cause stands first and is as grave as its symptoms; what nothing explains stands for itself."""

from __future__ import annotations

from camcal.trust.explanations import EXPLAINS, ORDER, explained
from camcal.verdict import Finding


def finding(code: str, level: str) -> Finding:
    """A finding of which only code and level matter."""
    return Finding(code, level, 1.0, code, "Do something.")


def test_a_cause_stands_before_its_symptom_and_is_as_grave():
    """Mixed cameras, found out as usable, explain an RMS that rejects: rejected, and the cameras are named first."""
    verdict = explained([finding("large_rms", "rejected"), finding("mixed_cameras", "usable")])
    assert verdict.word == "rejected"
    assert [(said.code, said.level) for said in verdict.findings] == [("mixed_cameras", "rejected"), ("large_rms", "rejected")]


def test_a_symptom_of_something_else_stays_first():
    """A bent board does not explain that the lens turns back inside the corners."""
    verdict = explained([finding("bent_board", "usable"), finding("fold_inside_corners", "rejected")])
    assert [said.code for said in verdict.findings] == ["fold_inside_corners", "bent_board"]


def test_what_is_explained_comes_after_what_is_not():
    """Halves that differ because of the bow come after a coefficient that no bow explains."""
    codes = ("inconsistent", "unsupported_coefficient", "bent_board")
    verdict = explained([finding(code, "usable") for code in codes])
    assert [said.code for said in verdict.findings] == ["bent_board", "unsupported_coefficient", "inconsistent"]
    assert explained([finding(code, "usable") for code in codes[:2]]).findings[0].code == "inconsistent"


def test_a_note_is_no_cause():
    """A lens that gains a percent from p1,p2 does not explain halves that differ by three times."""
    verdict = explained([finding("lens_too_simple", "note"), finding("inconsistent", "usable")])
    assert [(said.code, said.level) for said in verdict.findings] == [("inconsistent", "usable"), ("lens_too_simple", "note")]


def test_nothing_found_is_good():
    """No finding, or notes alone, leave the best word."""
    assert explained([]).word == explained([finding("one_distance", "note")]).word == "good"


def test_every_code_has_its_place():
    """Each cause and each symptom is named in the order, once."""
    codes = {*EXPLAINS, *(symptom for symptoms in EXPLAINS.values() for symptom in symptoms)}
    assert codes <= set(ORDER)
    assert len(set(ORDER)) == len(ORDER)
