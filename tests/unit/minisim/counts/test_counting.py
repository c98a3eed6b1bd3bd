"""Count sheets in three usual forms, what is left out of them, and broken ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from minisim.counts import read_counts
from minisim.errors import FileError, InputError, MinisimError
from minisim.fleet import fleet_named
from minisim.vehicle import VehicleType
from scenarios import four_way
from tests.builders import AMERICAN, BRITISH, GERMAN, read_count


def test_a_row_per_stream_and_a_column_per_class(tmp_path: Path) -> None:
    count = read_count(tmp_path, GERMAN)
    assert count.arms == ("A", "B", "C", "D")
    assert count.edges == (21_600, 22_500, 23_400)
    assert count.types == ("motorcycle", "car", "bus")
    assert count.classes["rad"] == "bicycles are not simulated"
    assert count.left_out == {"rad (bicycles are not simulated)": 48, "U-turns": 7}
    first, second = count.demand.periods
    assert first.rates == (4 * 66,) * 4
    assert first.turns == ((21, 24, 21),) * 4
    assert second.rates == (4 * 126,) * 4
    assert count.fleet["bus"] == pytest.approx([6 / 192] * 4)
    assert any("spur" in note for note in count.notes)
    assert "no vehicle was counted of: truck" in count.notes
    assert count.mix == "motorcycle:0.0312,car:0.9376,bus:0.0312"
    for fleet in (count.fleet, count.mix):
        fleet_named(fleet, VehicleType()).check(4)


def test_a_column_per_movement(tmp_path: Path) -> None:
    """NB is traffic to the north, from the south: lane c of N, E, S, W."""
    text = AMERICAN.replace("\t10\t80\t5\t1", "\t11\t80\t5\t1", 1)
    count = read_count(tmp_path, text, encoding="utf-8-sig")
    assert count.arms == ("N", "E", "S", "W")
    assert count.edges == (27_900, 28_800, 29_700)
    assert count.types == ("car",)
    assert count.left_out == {"U-turns": 4}
    assert count.demand.periods[0].turns == ((10, 80, 5), (10, 80, 5), (11, 80, 5), (10, 80, 5))
    assert "no classes: all count as cars" in count.notes


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_a_row_per_pair_of_arms_and_class(tmp_path: Path, encoding: str) -> None:
    count = read_count(tmp_path, BRITISH, {"classes": {"Pedal Cycle": "left out"}}, encoding)
    assert count.arms == ("1", "2", "3")
    assert count.types == ("car", "bus", "truck")
    assert count.vehicles.shape == (2, 3, 2, 3)
    assert (count.vehicles == [12.5, 1, 2]).all()
    assert count.left_out == {"Pedal Cycle (left out)": 48}


def test_a_sheet_is_of_one_day(tmp_path: Path) -> None:
    dated = GERMAN.replace(",06:", ",2012-05-08 06:")
    count = read_count(tmp_path, dated)
    assert count.edges == (21_600, 22_500, 23_400)
    with pytest.raises(FileError, match="a second day, 2012-05-09; keep the rows of one day"):
        read_count(tmp_path, dated.replace("05-08 06:15,", "05-09 06:15,"))


def test_a_number_that_may_be_thousands_is_refused(tmp_path: Path) -> None:
    """In a sheet of decimal commas."""
    with pytest.raises(FileError, match=r"'1\.200' may mean 1200 or 1\.2; write 1200 or 1,2"):
        read_count(tmp_path, BRITISH.replace("12,5", "1.200"))


def test_a_mapping_says_what_a_sheet_does_not(tmp_path: Path) -> None:
    text = GERMAN.replace("zufahrt", "leg no").replace("pkw", "P").replace(",A,", ",A,")
    mapping = {"approach": "leg no", "classes": {"P": "car"}, "arms": ["D", "A", "B", "C"],
               "turns": {"AG..(1)": "left", "AL..(1)": 2}, "from": "06:15"}  # fmt: skip
    count = read_count(tmp_path, text, mapping)
    assert count.arms == ("D", "A", "B", "C")
    assert count.demand.periods[0].turns[1] == (44, 41, 41)
    assert count.left_out["outside from … until"] > 0


def test_three_arms_are_left_and_right_of_each_other(tmp_path: Path) -> None:
    """At a T, the way ahead is the left one or the right one of the two."""
    text = "time,approach,turn,car\n" + "".join(
        f"{time},{arm},{turn},{n}\n"
        for time in ("7:00", "8:00")
        for arm, turn, n in (
            ("N", "left", 1), ("N", "right", 2), ("E", "thru", 3), ("E", "right", 4),
            ("W", "left", 5), ("W", "thru", 6),
        )
    )  # fmt: skip
    count = read_count(tmp_path, text)
    assert count.arms == ("N", "E", "W")
    assert count.demand.periods[0].turns == ((1, 2), (3, 4), (5, 6))


def test_a_missing_row_is_named(tmp_path: Path) -> None:
    lines = [line for line in GERMAN.splitlines() if not line.startswith("C,1,CG..(1),06:15")]
    count = read_count(tmp_path, "\n".join(lines))
    assert "C, manoeuvre 2: no row for the intervals from 06:15; taken as 0" in count.notes


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("06:15,06:30", "06:30,06:45", r"06:00-06:15 and 06:30-06:45 leave a hole; a mapping"),
        ("06:15,06:30", "06:10,06:25", r"06:00-06:15 and 06:10-06:25 overlap"),
        ("A,1,AG..(1),06:00,06:15", "A,1,AG..(1),06:00,06:20", r"begin at 06:00 and overlap"),
        ("pkw", "pkww", r"unknown class 'pkww'; did you mean 'pkw'\?"),
        ("AL..(1)", "A?", r"line 2: unknown turn 'A\?'; a mapping can say what it is"),
        ("2,1,20,0", "2,1,-20,0", r"line 2: a count must be a number 0 … 1e6, got '-20'"),
        ("2,1,20,0", "2,1,many,0", r"line 2: a count must be a number"),
        ("2,1,20,0", "2,1,20", r"line 2: 10 cells are needed, got 9"),
        ("06:00,06:15", "06:0x,06:15", r"line 2: a time must be a time of day"),
        ("06:15,06:30", "06:15,06:10", r"the interval 06:15-06:10 must end after its start"),
        ("zufahrt,", "x,", r"no column has the approach, and none is a movement such as NBL"),
        ("kennung", "x", r"no column has the turn or the exit"),
        ("intervall_start", "x", r"no column has the start of the intervals"),
        ("spur", "bus", r"more than one column 'bus'"),
        ("rad,krad,pkw,lkw,bus", "a,b,c,d,e", r"no column has counts: none is a class"),
    ],
)
def test_a_sheet_that_is_wrong_is_refused_in_one_sentence(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises(FileError, match=message) as caught:
        read_count(tmp_path, GERMAN.replace(old, new))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is not a table"),
        (b"a,b\n", "has no counts, only a header"),
        (b"\x00\x01,\x02", "it is not text"),
        (b'zufahrt,start\n"A', "cannot read counts"),
        (b"hello\nworld\n", "is not a table"),
    ],
)
def test_what_is_no_sheet_is_refused(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "sheet.csv").write_bytes(data)
    with pytest.raises(FileError, match=message):
        read_counts(tmp_path / "sheet.csv")


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        ({"aproach": "zufahrt"}, "unknown key of a mapping 'aproach'.*did you mean 'approach'"),
        ({"approach": "Zufart"}, "unknown column of .* for approach: 'Zufart'.*'zufahrt'"),
        ({"classes": {"pkw": "cra"}}, "unknown type of the class 'pkw', 'cra'.*'car'"),
        (
            {"arms": ["A", "B", "C"]},
            "line 11: the arm 'D' is missing among the arms of the mapping, A, B, C",
        ),
        ({"arms": 4}, "arms must be a sequence"),
        *(
            (
                {"turns": {"AL..(1)": k}},
                f"'AL..\\(1\\)' on 'A': 4 arms have manoeuvres 1 … 3, got {k}",
            )
            for k in (4, 0, -1)
        ),
        ({"arms": ["A", "B", "B", "C", "D"]}, "arms names 'B' twice"),
        ({"from": "09:00"}, r"nothing is left to simulate; left out: 823 outside from … until$"),
        ({"from": "07:00", "until": "06:00"}, "from must be before until, got 07:00 and 06:00"),
        ({"start": "intervall_ende", "end": "intervall_ende"}, "'intervall_ende' .* for two keys"),
        ({"from": "9h"}, "from must be a time of day"),
    ],
)
def test_a_wrong_mapping_is_refused(
    tmp_path: Path, mapping: dict[str, object], message: str
) -> None:
    with pytest.raises(MinisimError, match=message):
        read_count(tmp_path, GERMAN, mapping)


def test_five_arms_need_exits(tmp_path: Path) -> None:
    text = "time,approach,turn,car\n" + "".join(
        f"7:00,{k},left,1\n8:00,{k},left,1\n" for k in "12345"
    )
    with pytest.raises(FileError, match="with 5 arms, left on '1' does not say which exit"):
        read_count(tmp_path, text)


@pytest.mark.parametrize("n", [5, 6])
@pytest.mark.parametrize("wide", [False, True])
def test_with_exits_a_sheet_may_have_five_arms_or_more(tmp_path: Path, n: int, wide: bool) -> None:
    """From every arm to every other: as many vehicles as the rank of the exit, clockwise."""
    points = ("N", "NE", "SE", "S", "SW", "NW")[:n]
    counts = {(points[k], points[(k + j) % n]): j for k in range(n) for j in range(1, n)}
    header = ",".join(f"{a}-{b}" for a, b in counts) if wide else "from,to,car"
    lines = [
        f"{time},{row}" for time in ("7:00", "7:15")
        for row in ([",".join(map(str, counts.values()))] if wide
                    else [f"{a},{b},{count}" for (a, b), count in counts.items()])
    ]  # fmt: skip
    count = read_count(tmp_path, "\n".join([f"time,{header}", *lines]))
    assert count.arms == points
    assert count.demand.periods[1].turns == (tuple(range(1, n)),) * n
    assert len(count.demand.draw(n, 900.0, 1)) > 0


def test_a_mapping_says_which_exits_turns_of_five_arms_take(tmp_path: Path) -> None:
    text = "time,approach,turn,car\n" + "".join(
        f"{time},{arm},{turn},{number}\n"
        for time in ("7:00", "7:15") for arm in "12345"
        for number, turn in enumerate(("hard left", "left", "right", "hard right"), start=1)
    )  # fmt: skip
    turns = {"hard left": 1, "left": "2", "right": 3, "hard right": 4}
    count = read_count(tmp_path, text, {"turns": turns})
    assert count.demand.periods[0].turns == ((1, 2, 3, 4),) * 5


def test_columns_that_others_replace_are_named(tmp_path: Path) -> None:
    text = "time,from,to,count,car\n" + "".join(
        f"{time},{a},{b},9,1\n" for time in ("7:00", "7:15") for a in "123" for b in "123" if a != b
    )
    count = read_count(tmp_path, text)
    assert "columns not used: count" in count.notes
    assert count.vehicles.sum() == 12


def test_a_count_is_of_one_junction(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'sheet' has 3 lanes, the junction has 4"):
        four_way(
            demand=read_count(tmp_path, BRITISH, {"classes": {"Pedal Cycle": "left out"}}).demand
        )


def test_what_is_drawn_is_what_was_counted(tmp_path: Path) -> None:
    """Vehicles by movement over 40 runs, against the sheet's sums: Pearson's χ² of 12 cells."""
    count = read_count(tmp_path, GERMAN)
    sheet, drawn = 40 * count.vehicles.sum((0, 3)), np.zeros((4, 3))
    for seed in range(40):
        it = count.demand.draw(4, count.demand.duration, seed)
        np.add.at(drawn, (it.lane, it.manoeuvre - 1), 1)
    assert ((drawn - sheet) ** 2 / sheet).sum() < 32.9  # 0.1 % of χ² with 12 degrees of freedom


def test_empty_cells_and_counts_given_twice_are_named(tmp_path: Path) -> None:
    text = "time,from,to,count\n" + "".join(
        f"{time},{a},{b},9\n" for time in ("7:00", "7:15") for a in "123" for b in "123" if a != b
    )
    count = read_count(tmp_path, text.replace("7:15,1,2,9", "7:15,1,2,") + "7:00,1,2,9\n")
    assert "empty cells, taken as 0: 1, the first in line 8" in count.notes
    assert "counts given twice, and added: 1, the first in line 14" in count.notes


def test_a_class_without_a_row_is_named(tmp_path: Path) -> None:
    """Others have one in that interval, so the stream itself is not missing."""
    text = BRITISH.replace("Pedal Cycle", "Van").replace("07:15 - 07:30;1;3;PSV;1\n", "")
    count = read_count(tmp_path, text)
    assert [note for note in count.notes if "no row" in note] == [
        "class 'PSV': no row in 1 of 12 intervals and streams that others have, the first from "
        "07:15 on 1, manoeuvre 2; taken as 0"
    ]


def test_a_sheet_of_sums_alone_says_what_a_mapping_can_do(tmp_path: Path) -> None:
    text = GERMAN.replace("rad,krad,pkw,lkw,bus", "rad,fuss,Kfz,summe,gesamt")
    with pytest.raises(FileError, match=r"left out: .* Kfz \(a sum or .*a mapping can"):
        read_count(tmp_path, text)
    assert read_count(tmp_path, text, {"classes": {"Kfz": "car"}}).types == ("car",)
