"""The pages of `camcal verify` and `camcal regress`."""

from __future__ import annotations

import json

from messages import one_line
from report_pages import Page


def test_verify_writes_a_page(run, calibrated, dataset, tmp_path):
    """Passed with gates that hold, failed with its reason where one does not, and compared without any."""
    pages = {}
    for name, gates in {"compared": (), "passed": ("--max-sigma", "6"), "failed": ("--max-diff", "0.0001")}.items():
        code, _, err = run("verify", calibrated, "--truth", dataset, "--html", tmp_path / f"{name}.html", *gates)
        assert code == (5 if name == "failed" else 0)
        pages[name] = Page((tmp_path / f"{name}.html").read_text(encoding="utf-8"))
        assert pages[name].text["title"] == [f"{calibrated}: {name}"]
    reason = err.strip().removeprefix("camcal: verify: ")
    assert " ".join(reason.split()) in " ".join(pages["failed"].text["body"][0].split())
    assert all(reference["href"].startswith(("#", "data:")) for page in pages.values() for reference in page.all("link"))
    assert pages["compared"].text["th"][:6] == ["name", "true", "recovered", "difference", "± std. dev.", "in std. dev."]
    cells = pages["compared"].text["td"]
    assert "520" in cells
    assert "-0.18" in cells


def test_regress_writes_a_page(run, scene_file, tmp_path):
    """Measured without a baseline; failed, with scenario and figure, against one that is too good."""
    baseline, page = tmp_path / "baseline.json", tmp_path / "page.html"
    assert run("regress", scene_file, "--baseline", baseline, "--update-baseline", "--html", page)[0] == 0
    assert Page(page.read_text(encoding="utf-8")).text["title"] == ["Accuracy: measured"]
    stored = json.loads(baseline.read_text())
    stored["scenarios"]["small"]["corner_rms_px"] /= 2
    baseline.write_text(json.dumps(stored))
    assert run("regress", scene_file, "--baseline", baseline, "--html", page)[0] == 5
    failed = Page(page.read_text(encoding="utf-8"))
    assert failed.text["title"] == ["Accuracy: failed"]
    assert "corner_rms_px is" in failed.text["body"][0]
    assert sum("bad" in attributes.get("class", "") for attributes in failed.all("td")) == 1


def test_page_that_cannot_be_written_is_refused_before_the_work(run, calibrated, dataset, tmp_path):
    """A folder stands where the page of a verification should be: code 2."""
    (tmp_path / "page.html").mkdir()
    code, _, err = run("verify", calibrated, "--truth", dataset, "--html", tmp_path / "page.html")
    assert code == 2
    assert "a folder (expected a file to write)" in err


def test_a_page_replaces_only_a_page_of_camcals(run, calibrated, dataset, tmp_path):
    """The page is made again and again; a camera file, another HTML page and an empty file are refused and stay, code 2."""
    arguments = ("verify", calibrated, "--truth", dataset, "--html")
    for _ in range(2):
        assert run(*arguments, tmp_path / "page.html")[0] == 0
    for content in ((calibrated / "camera.yaml").read_text(), "<!doctype html><title>about camcal</title>", ""):
        (tmp_path / "mine").write_text(content)
        code, out, err = run(*arguments, tmp_path / "mine")
        assert (code, out) == (2, "")
        assert "mine: output file exists and is not a page that camcal wrote. Choose another name" in one_line(err)
        assert (tmp_path / "mine").read_text() == content
