"""Compiled functions are compiled anew when the code that they hold has changed, and only then."""

import pickle

import pytest

from vanedamp.coupling.numerics import jit
from vanedamp.coupling.numerics.jit import _sources


@pytest.fixture
def digest(tmp_path, monkeypatch):
    """Digest of a file of compiled functions in a chain caller -> callee -> records -> scenes."""
    texts = {
        "caller": "from vanedamp.callee import rise\n@entry\ndef climb(x): return rise(x)\n",
        "callee": "from vanedamp.records import STEP\n@kernel\ndef rise(x): return x + STEP\n",
        "records": "from vanedamp.scenes import Scene\nSTEP = 1.0\n",
        "scenes": "class Scene: pass\n",
    }
    for name, text in texts.items():
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.setattr(jit, "_PACKAGE", tmp_path)

    def after(edited=None, file="caller"):
        for name, text in texts.items():
            (tmp_path / f"{name}.py").write_text(text + ("\n# edited\n" if name == edited else ""))
        _sources.cache_clear()
        return _sources(tmp_path / f"{file}.py")

    yield after
    _sources.cache_clear()


@pytest.mark.parametrize("name", ["caller", "callee", "records"])
def test_code_that_a_function_holds_dates_it(digest, name):
    assert digest(name) != digest()


def test_data_behind_records_does_not_date_it(digest):
    assert digest("scenes") == digest()


def test_a_caller_does_not_date_its_callee(digest):
    assert digest("caller", "callee") == digest(None, "callee")


def test_a_cache_of_another_version_is_no_cache(tmp_path):
    """Its index may name records that are no more."""
    index = tmp_path / "index.nbi"
    index.write_bytes(pickle.dumps("0") + b"cvanedamp.coupling.system.system\nNoRecord\n.")

    def load():
        with index.open("rb") as file:
            pickle.load(file)
            return pickle.load(file)

    with pytest.raises(AttributeError):
        load()
    assert jit._forgiving(load)() == {}
