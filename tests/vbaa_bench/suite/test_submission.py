"""Submissions: everything that is missing or wrong is named in one pass."""

import re
from pathlib import Path

import pytest

from solver.instrument.errors import InputError
from solver.instrument.observation import Observations
from tests.vbaa_bench.suite.small import CODE, write_submission, write_suite
from vbaa_bench.suite.submission import check_submission, read_submission


@pytest.fixture
def suite(tmp_path: Path, small_scene: Path, variant: str) -> Path:
    return write_suite(tmp_path, small_scene, variant)


def table(observations: Observations, missing: int = 0) -> str:
    """A predictions file of the dataset of the tests."""
    frames = [frame.frame_id for frame in observations]
    return "frame_id,x_c_mm\n" + "".join(f"{name},120\n" for name in frames[missing:])


def test_predictions_and_code_that_can_be_sent(
    suite: Path, tmp_path: Path, observations: Observations
) -> None:
    files = {"pushes.csv": table(observations)}
    predictions = "predictions: {one/pushes: pushes.csv}"
    folder = write_submission(tmp_path / "files", suite, predictions, files)
    assert check_submission(folder) == []
    assert read_submission(folder).run_name == "mine"
    code = write_submission(tmp_path / "code", suite, "code: mine:halfway", {"mine.py": CODE})
    path = code / "method.yaml"
    path.write_text(path.read_text(encoding="utf-8").replace("link:", "# link:"), encoding="utf-8")
    assert check_submission(code) == []
    assert read_submission(code).run_name == "mine.halfway"


def test_all_mistakes_are_named_in_one_pass(
    suite: Path, tmp_path: Path, observations: Observations
) -> None:
    text = """
predictions: {one/pushes: pushes.csv, one/other: other.csv}
code: their:halfway
speed: fast
"""
    files = {"pushes.csv": table(observations, missing=1) + "abc,120\nabc,120\n"}
    folder = write_submission(tmp_path / "wrong", suite, text, files)
    path = folder / "method.yaml"
    broken = path.read_text(encoding="utf-8").replace("licence: Apache-2.0", "").replace("//", "/")
    path.write_text(broken, encoding="utf-8")
    wrong = "\n".join(one.sentence for one in check_submission(folder) if one.wrong)
    for part in (
        "licence is missing",
        "link is 'https:/example.org/mine', allowed is",
        "speed is an unknown key",
        "states both of predictions and code, allowed is one of them",
        "code is 'their:halfway', allowed is mine:FUNCTION",
        "predictions of 'one/other' are of no dataset of the suite, allowed is one of one/pushes",
        "frame_id 'abc' occurs more than once",
        "frame_id 'abc' and 1 more are not of one/pushes",
    ):
        assert part in wrong, wrong
    (note,) = [one.sentence for one in check_submission(folder) if not one.wrong]
    assert "1 of 4 frames of one/pushes are not predicted; they count as failures" in note
    with pytest.raises(InputError, match="licence is missing"):
        read_submission(folder)


@pytest.mark.parametrize(
    ("text", "files", "sentence"),
    [
        ("", {}, "states neither of predictions and code"),
        ("code: mine:halfway", {}, r"mine\.py: is missing"),
        ("code: mine:other", {"mine.py": CODE}, "does not define other"),
        ("code: mine:other", {"mine.py": "def"}, "is not Python"),
        ("predictions: {one/pushes: none.csv}", {}, r"none\.csv: is not a CSV or Parquet table"),
        ("predictions: {one/pushes: ../a.csv}", {}, "are outside of the folder"),
        ("predictions: {one/pushes: a.csv}", {"a.csv": "x\n1\n"}, "column frame_id is missing"),
        ("code: {a: 1}", {}, "code is"),
    ],
)
def test_a_single_mistake(
    suite: Path, tmp_path: Path, text: str, files: dict[str, str], sentence: str
) -> None:
    folder = write_submission(tmp_path / "sent", suite, text, files)
    with pytest.raises(InputError, match=sentence):
        read_submission(folder)


def test_a_folder_without_method_yaml_and_the_name_of_a_method(suite: Path, tmp_path: Path) -> None:
    (finding,) = check_submission(tmp_path)
    assert finding.sentence == f"{tmp_path / 'method.yaml'}: is missing"
    folder = write_submission(tmp_path / "sent", suite, "", {})
    path = folder / "method.yaml"
    text = path.read_text(encoding="utf-8").replace("name: mine", "name: exact_fit")
    path.write_text(text, encoding="utf-8")
    sentences = [finding.sentence for finding in check_submission(folder)]
    assert f"{path}: name is exact_fit, that of a method of solve" in sentences


def test_the_template_on_the_page_can_be_sent(tmp_path: Path) -> None:
    page = Path(__file__).parents[3] / "docs" / "suite.md"
    template, code = re.findall(r"```yaml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    method = tmp_path / "method.yaml"
    method.write_text(template, encoding="utf-8")
    findings = check_submission(tmp_path)
    assert [finding.sentence.rpartition(": ")[0] for finding in findings] == [
        str(tmp_path / name) for name in ("quickstart.csv", "springs.csv", "rigs.parquet")
    ]
    method.write_text(template.partition("predictions:")[0] + code, encoding="utf-8")
    (tmp_path / "my_method.py").write_text("def estimate(measurement): ...\n", encoding="utf-8")
    assert check_submission(tmp_path) == []
