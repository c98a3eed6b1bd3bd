"""Networks as they are, and files that are none."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import pytest

from minisim.errors import FileError
from minisim.town import reading
from minisim.town.reading import read_town
from tests.builders import town_text

STAR = {"a": (0.0, 100.0), "b": (100.0, 0.0), "c": (0.0, -100.0)}


def written(folder: Path, text: str | bytes, name: str = "town.net.xml") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def test_a_network_is_read_packed_or_not(tmp_path: Path) -> None:
    text = town_text(STAR)
    plain = read_town(written(tmp_path, text))
    packed = read_town(written(tmp_path, gzip.compress(text.encode()), "town.net.xml.gz"))
    for town in (plain, packed):
        assert town is not None
        assert sorted(town.nodes) == ["C", "a", "b", "c"]
        assert [edge.id for edge in town.into["C"]] == ["aC", "bC", "cC"]
        assert town.into["C"][0].length == pytest.approx(92.8)
        assert town.into["C"][0].street == "aC street"
        assert len(town.turns) == 9
        assert not town.left


def test_only_lanes_for_cars_count(tmp_path: Path) -> None:
    lanes = {
        "aC": ['allow="pedestrian"', 'disallow="tram rail"'],
        "bC": ['allow="bicycle"'],
        "cC": ['disallow="all"', 'allow="bus passenger"', ""],
    }
    town = read_town(written(tmp_path, town_text(STAR, lanes=lanes)))
    assert town is not None
    assert [(edge.id, edge.lanes) for edge in town.into["C"]] == [("aC", 1), ("cC", 2)]
    # The connections of lane 0, which is not for cars there.
    assert not {origin for origin, _ in town.turns}


def test_an_extract_of_openstreetmap_is_no_network(tmp_path: Path) -> None:
    assert read_town(written(tmp_path, "<osm><node id='1' lat='1' lon='2'/></osm>")) is None


@pytest.mark.parametrize(
    ("zone", "south", "turn"), [("+zone=32", "", 2.06), ("+zone=32 +south", "10000000", -2.06)]
)
def test_y_points_to_true_north(tmp_path: Path, zone: str, south: str, turn: float) -> None:
    """At 52.1° N or S and 2.61° east of the meridian of zone 32, tan γ = tan 2.61° · sin 52.1°."""
    x, y = 678_800.0, 5_775_300.0  # of that place by UTM [m]
    y = float(south) - y if south else y
    where = (
        f'<location netOffset="{-x},{-y}" convBoundary="-9,-9,9,9" origBoundary="" '
        f'projParameter="+proj=utm {zone} +datum=WGS84"/>'
    )
    text = town_text(STAR).replace("<edge ", f"{where}<edge ", 1)
    town = read_town(written(tmp_path, text))
    assert town is not None
    north = town.nodes["a"]  # of C, on the grid
    assert math.degrees(math.atan2(north.x, north.y)) == pytest.approx(turn, abs=0.01)
    along = town.into["C"][0].shape[0] - town.into["C"][0].shape[-1]
    assert math.degrees(math.atan2(*along)) == pytest.approx(turn, abs=0.01)


BOMB = '<!DOCTYPE n [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><net>&b;</net>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB, "declares a document type, which may hide entities"),
        ('<!DOCTYPE net SYSTEM "file:///etc/passwd"><net/>', "declares a document type"),
        ("<net><edge", "the XML is broken: "),
        ("", "the XML is broken: no element found"),
        (b"\x1f\x8bnot packed", "cannot be unpacked"),
        ("<html></html>", r"neither a network of SUMO .* begins with <html>"),
        ('<net><junction id="C" type="priority" x="nan" y="0"/></net>',
         "<junction> 'C': nan is not a finite number"),
        ('<net><edge id="e" from="a"><lane/></edge></net>', "<lane> '': no 'shape'"),
        ('<net><edge id="e" from="a" to="b"><lane shape="1,2" length="1" speed="1"/></edge></net>',
         "its shape needs two points or more"),
        ('<net><connection from="a" to="b" fromLane="x" toLane="0"/></net>', "<connection> 'a': "),
    ],
)  # fmt: skip
def test_what_is_no_network_is_refused_in_one_sentence(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    with pytest.raises(FileError, match=message):
        read_town(written(tmp_path, text))


def test_a_file_that_is_too_large_is_refused_packed_or_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading, "LARGEST", 10_000)
    text = f"<net>{' ' * 20_000}</net>".encode()
    with pytest.raises(FileError, match="it has more than"):
        read_town(written(tmp_path, text))
    with pytest.raises(FileError, match="larger than"):
        read_town(written(tmp_path, gzip.compress(text)))
