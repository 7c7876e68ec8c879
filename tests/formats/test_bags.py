"""ROS bags and MCAP as logs: what is mapped comes out as it was recorded, what is broken is said."""

from __future__ import annotations

import contextlib
import shutil
import tomllib
import tracemalloc
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from rosbags.typesys import get_types_from_msg

import bha
from bha.cli import main
from bha.errors import LogError, LogWarning, MissingExtraError

from .made_bags import KINDS, START, TOPICS, XYZW, Kind, Types, arm_messages, write

MAP: dict[str, Any] = {
    "schema": "bha-columns/1",
    "columns": {
        "/valves.data": {"channels": ["p11", "p12", "p13"], "unit": "bar(g)"},
        "/joints.position[lift]": "q11 [m]",
        "/joints.position[left]": "q12 [m]",
        "/tip": {"head": 1, "frame": "mocap"},
    },
}


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def mapped(*columns: tuple[str, Any], **time: Any) -> dict[str, Any]:
    return {"schema": "bha-columns/1", "columns": dict(columns), **({"time": time} if time else {})}


@pytest.fixture(scope="module", params=KINDS)
def bag(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp(request.param), request.param, TOPICS, arm_messages)


def test_topics_become_one_log_with_gaps(bag: Path) -> None:
    log = bha.Log.read(bag, mapping=MAP)
    # Valves, joints and tip come at three times each two steps of 10 ms; none are the same.
    # Nothing is known of the pressures after their last sample, so the last lengths are left out.
    assert len(log) == 50 + 49 + 25
    at_valves = np.isclose(log.time % 0.01, 0.0, atol=1e-6) | np.isclose(log.time % 0.01, 0.01, atol=1e-6)
    np.testing.assert_allclose(log.time[at_valves], np.arange(50) * 0.01, atol=1e-9)
    np.testing.assert_allclose(log["p12"][at_valves], 101_325.0 + 1e5 * 0.2 * np.arange(50))
    # Pressures lie on straight lines; lengths and heads are there when they were measured, and else are not.
    np.testing.assert_allclose(log["p11"], 101_325.0 + 1e5 * 0.1 * log.time / 0.01)
    measured = np.isfinite(log["q11"])
    assert measured.sum() == 49
    np.testing.assert_allclose(log["q11"][measured], 0.150 + 1e-3 * np.arange(49))
    np.testing.assert_allclose(log["q12"][measured], 0.160 + 1e-3 * np.arange(49))
    seen = np.isfinite(log["x1"])
    np.testing.assert_allclose(log["x1"][seen], 1e-3 * np.arange(0, 50, 2))
    quaternion = np.column_stack([log[f"o{axis}1"][seen] for axis in "xyzw"])
    np.testing.assert_allclose(quaternion, np.tile(XYZW, (25, 1)))
    assert log.missing
    assert any("recorded" in note for note in log.notes)
    assert any(f"{START} ns" in note for note in log.notes)
    assert any("p11, p12, p13 lie on straight lines" in note for note in log.notes)


def test_commands_hold_their_last_value(bag: Path) -> None:
    columns = {**MAP["columns"], "/valves.data": {"channels": ["pc11", "pc12", "pc13"], "unit": "bar(g)"}}
    log = bha.Log.read(bag, mapping=mapped(*columns.items()))
    assert len(log) == 50 + 50 + 25
    held = np.floor(log.time / 0.01 + 1e-6)
    np.testing.assert_allclose(log["pc11"], 101_325.0 + 1e5 * 0.1 * held)
    assert any("pc11, pc12, pc13 hold their last values" in note for note in log.notes)


def test_a_channel_that_is_read_less_often_misses_nothing(tmp_path: Path) -> None:
    """A row of another clock is none in which it was due; a message that was lost is."""
    arm = bha.robots.load("bha_nominal")
    time = np.arange(0.0, 4.0, 0.01)
    pressures = 1.3e5 + 1e4 * np.sin(time[:, None] * np.arange(2.0, 3.8, 0.2))
    run_of_arm = bha.simulate(arm, bha.Input(time, pressures), dt=0.02)
    lost = {40, 41, 42, 90}

    def made(types: Types) -> Iterable[tuple[int, str, Any]]:
        events: list[tuple[int, str, Any]] = []
        for t, values in zip(time, pressures, strict=True):
            events.append((START + round(1e9 * t), "/valves", types.floats(values)))
        for k, (t, head) in enumerate(zip(run_of_arm.time, run_of_arm.head_positions[:, 2], strict=True)):
            if k not in lost:
                at = START + round(1e9 * t) + 3_000_000
                events.append((at, "/tip", types.stamped(at, "mocap", head, XYZW)))
        return sorted(events, key=lambda event: event[0])

    path = write(tmp_path, "mcap", {"/valves": TOPICS["/valves"], "/tip": TOPICS["/tip"]}, made)
    columns = {"channels": list(arm.inputs), "unit": "Pa"}
    recording = bha.Recording(
        arm, bha.Log.read(path, mapping=mapped(("/valves.data", columns), ("/tip", {"head": 3, "parts": "position"})))
    )
    (x3, *_) = recording.facts
    rows = len(recording.log)
    assert x3.name == "x3"
    assert x3.interval == pytest.approx(0.02)
    # Two rows of the valves for each reading; 8 of them between the readings around three lost ones, 4 around one.
    assert round(x3.missing * rows) == 8 + 4
    np.testing.assert_allclose(recording.drive.pressures[:, 0].min(), pressures[:, 0].min(), rtol=1e-3)


def test_stamps_count_where_all_have_them(bag: Path) -> None:
    columns = [(source, value) for source, value in MAP["columns"].items() if source != "/valves.data"]
    log = bha.Log.read(bag, mapping=mapped(*columns))
    seen, measured = np.isfinite(log["x1"]), np.isfinite(log["q11"])
    # Joints are stamped 1 ms after the valves, poses 3 ms.
    np.testing.assert_allclose(log.time[measured], 0.01 * np.arange(50), atol=1e-9)
    np.testing.assert_allclose(log.time[seen], 0.002 + 0.02 * np.arange(25), atol=1e-9)
    assert any("stamps in the messages' headers" in note for note in log.notes)
    received = bha.Log.read(bag, mapping=mapped(*columns, stamp="received"))
    np.testing.assert_allclose(received.time[np.isfinite(received["x1"])], 0.003 + 0.02 * np.arange(25), atol=1e-9)
    mixed = bha.Log.read(bag, mapping=mapped(*MAP["columns"].items(), stamp="header"))
    assert any("when recorded for /valves" in note for note in mixed.notes)


def test_poses_of_all_types_are_the_same(bag: Path) -> None:
    logs = [
        bha.Log.read(bag, mapping=mapped((source, {"head": 1, "frame": "mocap"})))
        for source in ("/tip", "/odom", "/tf[mocap->tip]", "/tip.pose")
    ]
    for log in logs:
        assert len(log) == 25
        assert log == logs[0]
    part = bha.Log.read(bag, mapping=mapped(("/odom.pose.pose", {"head": 2, "parts": "position", "unit": "mm"})))
    np.testing.assert_allclose(part["x2"], 1e-6 * np.arange(0, 50, 2))
    assert "ow2" not in part


def test_fields_by_index_and_by_name(bag: Path) -> None:
    log = bha.Log.read(bag, mapping=mapped(("/valves.data[2]", "pc13 [kPa(g)]"), ("/tip.pose.position.y", "y1 [m]")))
    assert set(log.columns) == {"t", "pc13", "y1"}
    skipped = bha.Log.read(bag, mapping=mapped(("/valves.data", {"channels": ["", "p12 [Pa(g)]", ""]})))
    np.testing.assert_allclose(skipped["p12"], 101_325.0 + 0.2 * np.arange(50))


def test_the_list_is_a_mapping_that_can_be_used(bag: Path, tmp_path: Path) -> None:
    listed = run("convert", bag, "--list")
    assert listed.exit_code == 0, listed.output
    text = listed.output
    mapping = tomllib.loads(text)
    assert mapping["columns"]["/joints.position[lift]"].startswith("q1")
    assert mapping["columns"]["/valves.data"] == {"channels": ["p11", "p12", "p13"], "unit": "Pa"}
    for said in ('# "/tf[mocap->base]"', "no messages", "frame 'mocap'", "nav_msgs/msg/Odometry"):
        assert said in text
    path = tmp_path / "map.toml"
    path.write_text(text)
    out = tmp_path / "run.csv"
    result = run("convert", bag, "--columns", path, "--out", out)
    assert result.exit_code == 0, result.output
    assert "read it with --missing" in result.output
    assert bha.Log.read(out, missing=True)["p13"].max() > 0


def test_conversion_keeps_units_and_gauge(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.parquet"
    done = bha.logs.convert(bag, out, mapping=MAP)
    assert done.headings[:3] == ("t [s]", "p11 [bar(g)]", "p12 [bar(g)]")
    assert done.gaps
    direct, again = bha.Log.read(bag, mapping=MAP), bha.Log.read(out, missing=True)
    assert again == direct
    high = bha.Log.read(out, missing=True, ambient_pressure=9e4)
    assert high["p11"][0] == 9e4


def test_every_command_reads_it(bag: Path, tmp_path: Path) -> None:
    """With the mapping beside the bag; and with --columns."""
    copy = tmp_path / bag.name
    (shutil.copytree if bag.is_dir() else shutil.copy)(bag, copy)
    listed = run("convert", copy, "--list").output.replace('unit = "Pa"', 'unit = "kPa(g)"')
    arm = tmp_path / "arm.toml"
    options = ["--length", "150mm", "--radius", "60mm", "--diameter", "50mm", "--mass", "0.5", "--pressure-max", "1bar"]
    assert run("new", arm, *options).exit_code == 0
    result = run("simulate", arm, "--input", copy, "--json")
    assert "A mapping file says so: bha convert" in result.output
    (tmp_path / "columns.toml").write_text(listed)
    for command in (("simulate", arm, "--input", copy), ("check", arm, copy)):
        result = run(*command)
        assert result.exit_code == 0, result.output
    (tmp_path / "columns.toml").rename(tmp_path / "mine.toml")
    assert run("check", arm, copy, "--columns", tmp_path / "mine.toml").exit_code == 0
    recording = bha.Recording(bha.Arm.load(arm), bha.Log.read(copy, mapping=tmp_path / "mine.toml"))
    assert any("lie on straight lines" in note for note in recording.notes)


def test_a_mapping_makes_another_log(bag: Path) -> None:
    one = bha.Log.read(bag, mapping=mapped(("/valves.data[0]", "p11 [bar(g)]")))
    two = bha.Log.read(bag, mapping=mapped(("/valves.data[0]", "p11 [kPa(g)]")))
    assert one.sha256 != two.sha256
    assert len(str(one.sha256)) == 64


@pytest.mark.parametrize(
    ("source", "value", "said"),
    [
        ("/valve.data", "p11 [Pa]", "there is no topic of '/valve.data'; nearest: '/valves'"),
        ("/valves.dta[0]", "p11 [Pa]", "there is no field 'dta'; nearest: 'data'"),
        ("/valves.data[3]", "p11 [Pa]", ".data[3]: the array has 3 entries, counted from 0"),
        ("/valves.data", "p11 [Pa]", "is an array of 3 numbers; 1 channel is mapped to it"),
        ("/valves.data", {"channels": ["p11", "p12"], "unit": "Pa"}, "an array of 3 numbers; 2 channels are"),
        ("/joints.position[up]", "q11 [m]", "no such name beside the array; there are: right, lift, left"),
        ("/tip", "x1 [m]", "is a geometry_msgs/msg/PoseStamped, no number; name a field of it (header, pose)"),
        ("/tip", {"head": 1, "frame": "map"}, "message 1: found frame 'mocap'; the mapping says 'map'"),
        ("/valves", {"head": 1}, "is a std_msgs/msg/Float64MultiArray, no pose"),
        ("/tf[mocap->elbow]", {"head": 1}, "there is no transform from 'mocap' to 'elbow'"),
        ("/tip[a->b]", {"head": 1}, "messages hold no transforms between frames"),
        ("/empty.data", "p11 [Pa]", "/empty has no messages; leave it out"),
        ("/note.data", "p11 [Pa]", "no number"),
        ("/valves..data", "p11 [Pa]", "is no path; expected .field, [index]"),
        ("/valves.data[0]", "t [s]", "messages have times; choose with stamp"),
        ("/valves.data[0]", {"channel": "p11 [Pa]", "time": "/tip"}, "messages have times of their own; leave it out"),
    ],
)
def test_what_a_mapping_gets_wrong(bag: Path, source: str, value: Any, said: str) -> None:
    with pytest.raises(LogError) as error:
        bha.Log.read(bag, mapping=mapped((source, value)))
    assert said in str(error.value)


def clocked(stamps: Iterable[int], values: Iterable[float] | None = None) -> Any:
    """Poses with these stamps, ns after the start, recorded every 10 ms."""
    listed = list(stamps)
    numbers = list(values) if values is not None else [0.1] * len(listed)

    def made(types: Types) -> Iterable[tuple[int, str, Any]]:
        for k, (stamp, x) in enumerate(zip(listed, numbers, strict=True)):
            yield START + k * 10_000_000, "/tip", types.stamped(START + stamp, "mocap", (x, 0.0, 0.2), XYZW)

    return made


def test_a_clock_that_was_set_is_said(tmp_path: Path) -> None:
    only_tip = {"/tip": TOPICS["/tip"]}
    head = mapped(("/tip", {"head": 1}))
    even = [k * 10_000_000 for k in range(20)]
    back = write(tmp_path, "mcap", only_tip, clocked([*even[:10], *(t - 3_000_000_000 for t in even[10:])]))
    with pytest.raises(LogError, match=r"/tip, message 11: the stamps go back by 2.99 s: a clock was set"):
        bha.Log.read(back, mapping=head)
    assert len(bha.Log.read(back, mapping=mapped(("/tip", {"head": 1}), stamp="received"))) == 20
    on = write(tmp_path, "ros1", only_tip, clocked([*even[:10], *(t + 3_600_000_000_000 for t in even[10:])]))
    with pytest.warns(LogWarning, match=r"/tip: at message 11 the stamps jump by 3600 s against"):
        bha.Log.read(on, mapping=head)
    swapped = [*even[:5], even[6], even[5], *even[7:]]
    shuffled = write(tmp_path, "sqlite", only_tip, clocked(swapped, [1e-3 * t / 1e7 for t in swapped]))
    log = bha.Log.read(shuffled, mapping=head)
    np.testing.assert_allclose(log["x1"], 1e-3 * np.arange(20))
    assert any("out of order by up to 10 ms were sorted" in note for note in log.notes)


def test_stamps_of_zero_and_samples_that_are_no_numbers(tmp_path: Path) -> None:
    only_tip = {"/tip": TOPICS["/tip"]}
    head = mapped(("/tip", {"head": 1}))
    unset = write(tmp_path, "mcap", only_tip, clocked([0, 10_000_000, -START, 30_000_000]))
    with pytest.raises(LogError, match=r"/tip, message 3 has the stamp 0; stamp = \"received\""):
        bha.Log.read(unset, mapping=head)
    nothing = write(tmp_path, "ros1", only_tip, clocked([-START] * 5))
    assert any("/tip has no stamps" in note for note in bha.Log.read(nothing, mapping=head).notes)
    absent = write(tmp_path, "sqlite", only_tip, clocked([0, 10_000_000, 20_000_000], [0.1, float("nan"), 0.3]))
    with pytest.raises(LogError, match=r"/tip, sample 2, column 'x1 \[m\]': found nan; take such samples as missing"):
        bha.Log.read(absent, mapping=head)
    assert np.isnan(bha.Log.read(absent, mapping=head, missing=True)["x1"]).tolist() == [False, True, False]


def test_pressures_that_were_never_measured_together(tmp_path: Path) -> None:
    def apart(types: Types) -> Iterable[tuple[int, str, Any]]:
        for k in range(40):
            yield START + (k + k // 20) * 10_000_000, "/valves" if k < 20 else "/more", types.floats([0.1])

    path = write(tmp_path, "mcap", {"/valves": TOPICS["/valves"], "/more": TOPICS["/valves"]}, apart)
    with pytest.raises(LogError, match="/valves and /more were never measured together"):
        bha.Log.read(path, mapping=mapped(("/valves.data[0]", "p11 [bar]"), ("/more.data[0]", "p12 [bar]")))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.0, 0.0005, 0.02, 0.4, 0.7, 0.97, 0.999])
def test_a_bag_that_was_cut_off_is_an_error(tmp_path: Path, kind: Kind, share: float) -> None:
    path = write(tmp_path, kind, TOPICS, arm_messages)
    file = path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    for target in {path, file}:
        with pytest.raises(LogError):
            bha.Log.read(target, mapping=MAP)
        result = run("convert", target, "--list")
        assert result.exception is None or isinstance(result.exception, SystemExit), result.output


def test_damaged_bytes_never_end_in_a_traceback(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    for kind in KINDS:
        path = write(tmp_path, kind, TOPICS, lambda types: arm_messages(types, 12))
        file = path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")
        content = np.frombuffer(file.read_bytes(), np.uint8)
        for _ in range(25):
            damaged = content.copy()
            places = random.integers(0, len(damaged), 12)
            damaged[places] = random.integers(0, 256, 12)
            file.write_bytes(damaged.tobytes())
            with contextlib.suppress(LogError):
                bha.Log.read(path, mapping=MAP, missing=True)


def test_definitions_that_nobody_has(tmp_path: Path) -> None:
    types = Types(ros1=False)
    types.store.register(get_types_from_msg("float64 pressure\nfloat64 flow", "my_valves/msg/Valve"))

    def made(types: Types) -> Iterable[tuple[int, str, Any]]:
        for k in range(10):
            yield START + k * 10_000_000, "/valve", types("my_valves/msg/Valve", 1e5 + k, 0.0)

    topics, column = {"/valve": "my_valves/msg/Valve"}, mapped(("/valve.pressure", "p11 [Pa]"))
    known = write(tmp_path, "mcap", topics, made, types)
    np.testing.assert_allclose(bha.Log.read(known, mapping=column)["p11"], 1e5 + np.arange(10))
    assert '"/valve.pressure" = "p11 [Pa]"' in run("convert", known, "--list").output
    bare = write(tmp_path, "sqlite", topics, made, types)
    _without_definitions(bare)
    with pytest.raises(LogError, match=r"/valve: the definition of my_valves/msg/Valve is neither in the bag nor"):
        bha.Log.read(bare, mapping=column)
    assert "neither in the bag nor" in run("convert", bare, "--list").output


def _without_definitions(bag: Path) -> None:
    """As bags of ROS 2 were until Iron."""
    import sqlite3  # noqa: PLC0415

    with sqlite3.connect(next(bag.glob("*.db3"))) as database:
        database.execute("DELETE FROM message_definitions")
    database.close()


def test_without_rosbags_the_extra_is_named(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "rosbags.rosbag1", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'bha\[bags\]'"):
        bha.Log.read(bag, mapping=MAP)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_not_mapped_takes_no_memory(tmp_path: Path, kind: Kind) -> None:
    """A bag of 20 MB of which 50 numbers are mapped."""

    def made(types: Types) -> Iterable[tuple[int, str, Any]]:
        for k in range(50):
            yield START + k * 10_000_000, "/valves", types.floats([float(k)])
            yield START + k * 10_000_000, "/camera", types("std_msgs/msg/String", "x" * 400_000)

    path = write(tmp_path, kind, {"/valves": TOPICS["/valves"], "/camera": "std_msgs/msg/String"}, made)
    column = mapped(("/valves.data[0]", "p11 [bar(g)]"))
    bha.Log.read(path, mapping=column)  # what is imported once
    tracemalloc.start()
    log = bha.Log.read(path, mapping=column)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(log) == 50
    assert peak < 6e6
