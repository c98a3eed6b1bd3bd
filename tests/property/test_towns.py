"""Networks with random faults: an intersection that drives, a verdict, or one clear error."""

from __future__ import annotations

import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from minisim.errors import MinisimError
from minisim.town import survey
from tests.builders import town_text

places = st.lists(
    st.tuples(st.integers(-300, 300), st.integers(-300, 300)).filter(lambda p: p != (0, 0)),
    min_size=1, max_size=6, unique=True,
)  # fmt: skip
#: What some number or word of the file becomes.
faults = st.sampled_from(["", "nan", "-1", "0", "1e9", "x", "C", "passenger", "true", "<net>", '"'])


@given(places, st.booleans(), st.lists(st.tuples(st.integers(0, 400), faults), max_size=2))
@example([(0, 100), (100, 0), (0, -100)], False, [])
def test_no_network_gives_a_traceback(
    tmp_path_factory: pytest.TempPathFactory, at: list[tuple[int, int]], left: bool,
    broken: list[tuple[int, str]],
) -> None:  # fmt: skip
    text = town_text({chr(97 + k): place for k, place in enumerate(at)}, left=left)
    words = re.split(r"([\w.-]+)", text)
    for k, word in broken:
        words[(2 * k + 1) % (len(words) - 1)] = word
    path = tmp_path_factory.mktemp("town") / "town.net.xml"
    path.write_text("".join(words))
    try:
        every = survey(path)
    except MinisimError:
        return
    for found in every:
        assert found.verdict
        if found.intersection is not None:
            assert len(found.intersection.bearings) == len(found.arms)
