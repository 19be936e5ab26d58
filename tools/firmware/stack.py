# SPDX-License-Identifier: MIT
"""The most stack that an image can need, from what the compiler wrote down.

gcc's -fcallgraph-info=su gives the functions of each source with their frames and calls (.ci files,
in VCG form). Functions of the C library come without; their frames are read from the machine code.
What a call through a pointer may reach cannot be seen by a machine: INDIRECT says it, by hand, and
a call that it does not cover is an error. So are recursion and frames without a bound. A pattern
with a colon names the source too: twist.c:step.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from pelorus.errors import PelorusError

# Which functions call through a pointer, and what they may reach: patterns of function names. Of
# the session's observers the firmware sets one, the telemetry's, and that not in every image.
MODEL = (r"body_\w+", r"world_\w+")
PROCESS = (
    r"(twist|imu)\.c:(lay_out|check|step|mean|hold|missed|rest|walk|bias_walk|now|bias_covariance"
    r"|measure)"
)
BIAS_WALK = (r"(twist|imu)\.c:bias_walk",)
MAP = ("send_evicted", "find_known")
PORT = ("receive", "transmit", "now_ns", "idle", "feed_watchdog")
TELEMETRY = "send_odometry"
DEVICE = r"(ram|flash)_(read|program|erase)"
STORE = (
    r"plr_state_store_\w+|look_\w+|read_(bytes|crc|slot|state)|write_slot|erase_blocks|program\w*"
    r"|flush|append_state"
)
SESSION = (
    r"use_(step|frame|reading|until|kind_until|ready)|update_by|predict|update|answer|take|wait"
    r"|plr_(use|events|queue|clock)\w*|refuse_step|report_(fault|divergence)"
)
HANDLERS = (
    r"plr_start_(begin|change_settings|add_landmark)",
    r"plr_events_take_\w+",
    r"plr_saving_restore",
    r"save|compare_counts",
)
FILTER = (
    r"plr_(filter|predict|correct|consistency|gate|motion|slots|births|match|landmarks|relocate)\w*"
    r"|process|take_step|add_missed|finish_motion|gate_each|append_new|take_up|begin_at"
)
INDIRECT: tuple[tuple[str, tuple[str, ...]], ...] = (
    (r"plr_order_sort|sink", (r"(gain|position|id)_before",)),
    (r"to_frame|send_frame|send|plr_writer_put", (*PORT, r"panic\.c:send")),
    (STORE, (DEVICE,)),
    (r"move|pass_\w+|plr_codec_\w+", (r"(from|to)_(payload|frame|source|sink|header)",)),
    (r"from_source|to_sink|plr_filter_save", ("append_state", "read_state")),
    (r"plr_session_step|feed_reader|handle", (*PORT, TELEMETRY, *HANDLERS)),
    (SESSION, (*PORT, TELEMETRY)),
    (r"plr_start_\w+|plr_send_\w+|echo", ()),
    (r"plr_correct|plr_correct_towards|move_estimate", (r"(body|world)_retract",)),
    (r"hold|apply|apply_to_velocity|plr_measure_twist", (*MODEL, "measure", PROCESS)),
    (r"plr_stereo\w*", (r"(body|world)_(look|derive|initialise|adopt|in_world)",)),
    (
        r"plr_bias_prior_variance|plr_evidence_complete|add_biases|prior_of_drivers"
        r"|restore_bias_prior",
        BIAS_WALK,
    ),
    (r"plr_filter_(propagate_recovery|recover)", BIAS_WALK),
    (r"plr_bias_\w+", (PROCESS,)),
    (r"plr_map_ask", ("find_known",)),
    (FILTER, (*MODEL, *MAP, PROCESS)),
)

NODE = re.compile(r'node: \{ title: "([^"]+)" label: "([^"]*)"')
EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
BYTES = re.compile(r"(\d+) bytes \(([^)]+)\)")
FUNCTION = re.compile(r"^[0-9a-f]+ <([^>]+)>:$")
PUSHES = re.compile(r"\t(push|stmdb|vpush)\S*\t(?:sp!, )?\{([^}]*)\}")
LOWERS = re.compile(r"\tsub(?:\.w|w)?\tsp, (?:sp, )?#(\d+)")
CALLS = re.compile(r"\tb[a-z.]*\t[0-9a-f]+ <([^>+]+)>")
INDIRECT_CALL = "__indirect_call"
# gcc notes the signed function's name where it calls the unsigned one.
SAME_AS = {"__aeabi_ldivmod": "__aeabi_uldivmod"}

INTERRUPTS = ("serial_link_isr", "serial_telemetry_isr", "clock_isr")
EXCEPTION_FRAME_BYTES = 26 * 4 + 4  # eight words, eighteen of the FPU, alignment


@dataclass
class Function:
    """A frame and the functions that are called from it."""

    frame_bytes: int = 0
    calls: set[str] = field(default_factory=set)
    from_compiler: bool = False


@dataclass(frozen=True)
class Bound:
    """A depth, and the calls that lead to it."""

    stack_bytes: int
    path: tuple[str, ...]


def short(title: str) -> str:
    """Returns the name; a static function's title is file:name."""
    return title.rpartition(":")[2]


def _where(title: str) -> str:
    """Returns file.c:name of a static function, without gcc's suffixes of its clones."""
    file, _, name = title.rpartition(":")
    return f"{Path(file).name}:{name.partition('.')[0]}"


def read_call_graphs(folders: Iterable[Path]) -> dict[str, Function]:
    """Reads every function of the .ci files below the folders."""
    functions: dict[str, Function] = {}
    for path in sorted(file for folder in folders for file in folder.rglob("*.ci")):
        text = path.read_text()
        for title, label in NODE.findall(text):
            measured = BYTES.search(label)
            if measured is None:
                continue  # declared here, defined elsewhere
            if measured[2] != "static" and "bounded" not in measured[2]:
                raise PelorusError(f"{path}: {title} has a frame without a bound")
            function = functions.setdefault(title, Function())
            function.frame_bytes = int(measured[1])
            function.from_compiler = True
        for source, target in EDGE.findall(text):
            functions.setdefault(source, Function()).calls.add(target)
    if not functions:
        raise PelorusError("no .ci files: the images are built with -fcallgraph-info=su")
    return functions


def _register_count(names: str) -> int:
    count = 0
    for name in names.split(","):
        first, _, last = name.strip().partition("-")
        width = 2 if first.startswith("d") else 1
        count += width * (1 if not last else int(last[1:]) - int(first[1:]) + 1)
    return count


def add_machine_code(functions: dict[str, Function], image: Path) -> None:
    """Adds the image's functions that the compiler did not describe: libc and libgcc."""
    listing = subprocess.run(
        ["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", str(image)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    current: Function | None = None
    name = ""
    known = {short(title) for title in functions}
    for line in listing.splitlines():
        if begins := FUNCTION.match(line):
            name = begins[1]
            current = None if name in known else functions.setdefault(name, Function())
        elif current is not None:
            if pushed := PUSHES.search(line):
                current.frame_bytes += 4 * _register_count(pushed[2])
            elif lowered := LOWERS.search(line):
                current.frame_bytes += int(lowered[1])
            elif (called := CALLS.search(line)) and called[1] != name:
                current.calls.add(called[1])


def add_aliases(functions: dict[str, Function], image: Path) -> None:
    """Gives every name of an address what is known of one of them."""
    symbols = subprocess.run(
        ["arm-none-eabi-nm", str(image)], capture_output=True, text=True, check=True
    ).stdout
    names: dict[str, list[str]] = {}
    for address, kind, name in (line.split() for line in symbols.splitlines()):
        if kind in "tTwW":
            names.setdefault(address, []).append(name)
    for group in names.values():
        known = next((functions[name] for name in group if name in functions), None)
        if known is not None:
            for name in group:
                functions.setdefault(name, known)
    for name, same in SAME_AS.items():
        if same in functions:
            functions.setdefault(name, functions[same])


class Analysis:
    """Computes depths over a call graph without recursion."""

    def __init__(self, functions: dict[str, Function]) -> None:
        self._functions = functions
        self._by_name: dict[str, list[str]] = {}
        for title in functions:
            self._by_name.setdefault(short(title), []).append(title)
        self._known: dict[str, Bound] = {}

    def bound(self, name: str, above: tuple[str, ...] = ()) -> Bound:
        """Returns the deepest stack below a call of this function, itself included."""
        if name in above:
            raise PelorusError(f"recursion: {' -> '.join((*map(short, above), short(name)))}")
        if name not in self._known:
            self._known[name] = self._deepest(name, above)
        return self._known[name]

    def _deepest(self, name: str, above: tuple[str, ...]) -> Bound:
        function = self._functions.get(name)
        if function is None:
            caller = short(above[-1]) if above else "the vector table"
            raise PelorusError(f"nothing is known of {name}, called by {caller}")
        deepest = Bound(0, ())
        for callee in sorted(self._callees(name, function)):
            found = self.bound(callee, (*above, name))
            if found.stack_bytes > deepest.stack_bytes:
                deepest = found
        return Bound(function.frame_bytes + deepest.stack_bytes, (short(name), *deepest.path))

    def _callees(self, name: str, function: Function) -> set[str]:
        callees = set()
        for target in function.calls:
            if target == INDIRECT_CALL:
                callees |= self._reachable_from(short(name))
            else:
                callees.add(target)
        return callees

    def _named(self, pattern: str) -> set[str]:
        titles = {
            title
            for name, titles in self._by_name.items()
            for title in titles
            if re.fullmatch(pattern, _where(title) if ":" in pattern else name.partition(".")[0])
            if self._functions[title].from_compiler
        }
        if not titles and pattern != TELEMETRY:
            raise PelorusError(f"INDIRECT names {pattern}, and there is no such function")
        return titles

    def _reachable_from(self, caller: str) -> set[str]:
        base = caller.partition(".")[0]  # gcc's clones: name.isra.0
        for callers, targets in INDIRECT:
            if re.fullmatch(callers, base):
                return set().union(*(self._named(target) for target in targets))
        raise PelorusError(f"{caller} calls through a pointer, and INDIRECT does not say what")


def image_bound(image: Path, folders: Iterable[Path]) -> Bound:
    """Returns the most stack that main can need, with one interrupt on top (they do not nest)."""
    functions = read_call_graphs(folders)
    add_machine_code(functions, image)
    add_aliases(functions, image)
    analysis = Analysis(functions)
    start = functions["startup_reset"].frame_bytes + functions["startup_main"].frame_bytes
    main = analysis.bound("main")
    handlers = [analysis.bound(name) for name in INTERRUPTS]
    interrupt = max(handler.stack_bytes for handler in handlers) + EXCEPTION_FRAME_BYTES
    return Bound(start + main.stack_bytes + interrupt, main.path)
