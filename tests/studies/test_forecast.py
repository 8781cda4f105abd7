"""Time left of work whose parts differ in cost."""

from vanedamp.studies.forecast import Forecast


def test_work_left_is_that_of_parts_as_long_as_they_have_been():
    calls = []
    work = Forecast(lambda *call: calls.append(call), {"quick": (3, "quick", 1.0), "slow": (2, "quick", 10.0)})
    for kept in (True, False, False):
        work.ended("quick", 2.0, kept)
    assert calls == [(2, 23), (3, 23)]  # as is assumed
    work.ended("slow", 40.0)
    work.expect("slow", 2)  # one more
    assert calls[-1] == (23, 43)
    work.ended("slow", 60.0)
    assert calls[-1] == (53, 78)
    work.ended("slow", 50.0)
    assert calls[-1] == (78, 78)
    Forecast(None, {"quick": (1, "quick", 1.0)}).ended("quick", 1.0)
