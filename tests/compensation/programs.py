"""Programs made of pieces, so that a test knows which characters are numbers of targets."""

import re
from dataclasses import dataclass

from hypothesis import settings
from hypothesis import strategies as st

# programs take long to make; `--hypothesis-profile=thorough` makes more all the same
FEWER = settings(max_examples=(settings.default.max_examples if settings.default else 100) // 4)
NUMBER = rb"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"


@dataclass(frozen=True)
class Pieces:
    """What stands between the numbers (n + 1), and the numbers as text (n)."""

    between: tuple[str, ...]
    numbers: tuple[str, ...]

    @property
    def text(self) -> str:
        """The program."""
        parts = [part for pair in zip(self.between, self.numbers, strict=False) for part in pair]
        return "".join([*parts, self.between[-1]])

    def pattern(self) -> re.Pattern[bytes]:
        """Return what matches the program with any numbers; blanks in front of a number may give way."""
        *heads, last = [piece.encode("latin-1") for piece in self.between]
        parts = [re.escape(head.rstrip(b" ")) + rb" *(" + NUMBER + b")" for head in heads]
        return re.compile(b"".join(parts) + re.escape(last))


def number_texts(size: float) -> st.SearchStrategy[str]:
    """Return numbers up to a size as people and programs write them."""
    value = st.floats(-size, size).filter(lambda number: abs(number) > 1e-3)
    forms = (
        lambda number: f"{number:.3f}",
        lambda number: f"{number:+.2f}",
        lambda number: f"{number:.8f}",
        lambda number: f"{number:.6E}",
        lambda number: f"{number:.4e}",
        lambda number: f"{round(number)}",
        lambda number: f"{round(number)}.",
    )
    return st.builds(lambda number, form: form(number), value, st.sampled_from(forms))


BLANKS = st.sampled_from(["", " ", "  ", "\t", " \t "])
GAPS = st.sampled_from([" ", "  ", "     ", "\t"])
ENDS = st.sampled_from(["\n", "\r\n", "\r"])
REMARKS = st.text(st.characters(codec="latin-1", exclude_categories=["Cc"]), max_size=20)


def joined(lines: list[list[str]], end: str) -> Pieces:
    """Return pieces of lines that alternate between text and number, each ending with text."""
    between, numbers = [""], []
    for line in lines:
        between[-1] += line[0]
        for at in range(1, len(line), 2):
            numbers.append(line[at])
            between.append(line[at + 1])
        between[-1] += end
    return Pieces(tuple(between), tuple(numbers))


@st.composite
def krl_programs(draw: st.DrawFn) -> tuple[Pieces, int]:
    """Return a KRL program and its number of targets."""
    end, count = draw(ENDS), draw(st.integers(1, 4))
    remarks = REMARKS.map(lambda text: f"; {text}")
    lines = [["&ACCESS RVP"], ["DEF a( )"], [draw(remarks)]]
    for number in range(count):
        head = draw(
            st.sampled_from(
                [
                    f"DECL E6POS XP{number}={{",
                    f"XP{number} = {{",
                    "LIN {",
                    "ptp {E6POS: ",
                    "  SPL {",
                    "CIRC {FRAME :",
                ]
            )
        )
        line = [head]
        keys = "XYZABC" if draw(st.booleans()) else "xyzabc"
        for at, key in enumerate(keys):
            line[-1] += f"{draw(BLANKS)}{key}{draw(GAPS)}"
            line += [draw(number_texts(2000.0 if at < 3 else 170.0)), draw(BLANKS) + ("," if at < 5 else "")]
        line[-1] += draw(st.sampled_from(["}", ",S 2,T 35}", ",S 'B010',T 2,E1 0.0}"])) + draw(remarks)
        lines.append(line)
        lines.append([draw(st.sampled_from(["", "WAIT SEC 0.5", "PTP {A1 0,A2 -90,A3 90}", 'x="{X 1"']))])
    return joined(lines, end), count


QUATERNIONS = (
    ("1", "0", "0", "0"),
    ("0.70710678", "0", "0.70710678", "0"),
    ("-.5", "0.5", "-5.0E-01", "0.5"),
    ("0.182574", "-0.365148", "0.547723", "0.730297"),
)


@st.composite
def rapid_modules(draw: st.DrawFn) -> tuple[Pieces, int]:
    """Return a RAPID module and its number of targets."""
    end, count = draw(ENDS), draw(st.integers(1, 4))
    remarks = REMARKS.map(lambda text: f" ! {text}")
    tail = "[1,1,0,0],[9E9,9E+09,9E9,9E9,9E9,0]]"
    lines = [["MODULE m"], [draw(remarks)]]
    for number in range(count):
        head, foot = draw(
            st.sampled_from(
                [
                    (f"CONST robtarget p{number}:=[", ";"),
                    (f"  LOCAL PERS  RobTarget p{number} := [", " ;"),
                    ("MoveL [", ",v100,z5,tool0\\WObj:=w1;"),
                    ("MoveJ\\Conc,[", ", v1000, fine, t;"),
                ]
            )
        )
        line = [head + draw(BLANKS) + "["]
        for at in range(3):
            line[-1] += draw(BLANKS)
            line += [draw(number_texts(2000.0)), draw(BLANKS) + ("," if at < 2 else "]")]
        line[-1] += draw(BLANKS) + "," + draw(st.sampled_from(["", end])) + draw(BLANKS) + "["
        quaternion = draw(st.sampled_from(QUATERNIONS))
        for at, text in enumerate(quaternion):
            line += [text, draw(BLANKS) + ("," if at < 3 else "]")]
        line[-1] += "," + draw(BLANKS) + tail + foot + draw(remarks)
        lines.append(line)
        lines.append([draw(st.sampled_from(["", 'TPWrite "[[1,2,3]";', "WaitTime 1;"]))])
    return joined(lines, end), count


@st.composite
def ur_scripts(draw: st.DrawFn) -> tuple[Pieces, int]:
    """Return a URScript program and its number of targets."""
    end, count = draw(ENDS), draw(st.integers(1, 4))
    lines = [["def prog():"], ["  # " + draw(REMARKS)], ["  set_tcp(p[0,0,0.1,0,0,0])"]]
    for number in range(count):
        head, foot = draw(
            st.sampled_from(
                [
                    ("  movel(p[", "], a=1.2, v=0.25, r=0)"),
                    ("movej(get_inverse_kin( p[", "]), a=1)"),
                    ("  movel(pose_trans(plane, p [", "]), 1.2,0.25)"),
                    (f"  global Way_{number} = p[", f"] ; movej(Way_{number})"),
                ]
            )
        )
        line = [head]
        for at in range(6):
            line[-1] += draw(BLANKS)
            line += [draw(number_texts(2.0)), draw(BLANKS) + ("," if at < 5 else foot)]
        line[-1] += draw(st.sampled_from(["", " # p[1,2,3,4,5,6]"]))
        lines.append(line)
        lines.append([draw(st.sampled_from(["", 'textmsg("p[1,2,3,4,5,6]")', "x = [1,2,3,4,5,6]"]))])
    return joined([*lines, ["end"]], end), count


@st.composite
def tp_programs(draw: st.DrawFn) -> tuple[Pieces, int]:
    """Return a FANUC program and its number of targets."""
    end, count = draw(st.sampled_from(["\n", "\r\n"])), draw(st.integers(1, 4))
    lines = [["/PROG  A"], ["/MN"], ["   1:J P[1] 100% FINE    ;"], ["/POS"]]
    for number in range(1, count + 1):
        comment = draw(st.sampled_from(["", ':"pick"']))
        config = draw(st.sampled_from(["N U T, 0, 0, 0", "F D B, 0, -1, 0", "N, 0, 0, 0"]))
        lines += [[f"P[{number}{comment}]{{"], ["   GP1:"], [f"\tUF : 0, UT : 1,\t\tCONFIG : '{config}',"]]
        line = [""]
        for key, unit in zip("XYZWPR", ["mm"] * 3 + ["deg"] * 3, strict=True):
            line[-1] += f"\t{key} ={draw(GAPS)}"
            value = draw(number_texts(2000.0 if unit == "mm" else 80.0))
            line += [value, f" {unit}" + ("" if key == "R" else ",")]
        lines += [line, ["   GP2:"], ["\tUF : 0, UT : 1,\t"], ["\tJ1=     6.378 deg"], ["};"]]
    return joined([*lines, ["/END"]], end), count


AXES = (("0", "0", "1"), ("0.6", "0.0", "8.0E-01"), ("-.7071068", "0", ".7071068"), ("1.", "0", "0"))


@st.composite
def apt_files(draw: st.DrawFn) -> tuple[Pieces, int]:
    """Return an APT file and its number of targets."""
    end, count = draw(ENDS), draw(st.integers(1, 4))
    lines = [["PARTNO " + draw(REMARKS).replace("$", "")], ["MULTAX/ON"], ["FROM/0,0,100"]]
    for _ in range(count):
        line = [draw(st.sampled_from(["GOTO/", "goto / ", "  GOTO/\t", "12 GOTO /"]))]
        for at in range(3):
            line[-1] += draw(BLANKS)
            line += [draw(number_texts(900.0)), draw(BLANKS) + ("," if at < 2 else "")]
        if draw(st.booleans()):
            line[-1] += "," + draw(st.sampled_from(["", "$" + end + "   "]))
            for at, text in enumerate(draw(st.sampled_from(AXES))):
                line += [text, draw(BLANKS) + ("," if at < 2 else "")]
        line[-1] += draw(st.sampled_from(["", " $$ 1,2,3 ", "$$"]))
        lines.append(line)
        lines.append(
            [draw(st.sampled_from(["", "FEDRAT/20,MMPM", "PPRINT GOTO/1,2", "$$ GOTO/1,2,3", "RAPID"]))]
        )
    return joined([*lines, ["FINI"]], end), count


HEADERS = {
    "mm, deg": ("x [mm]", "y [mm]", "z [mm]", "a [deg]", "b [deg]", "c [deg]"),
    "SI": ("x", "y", "z", "a", "b", "c"),
    "mixed": ("x [cm]", "y [in]", "z [m]", "a [rad]", "b [mrad]", "c [deg]"),
}


@st.composite
def path_tables(draw: st.DrawFn) -> tuple[Pieces, int]:
    """Return a path table and its number of rows."""
    end, count = draw(ENDS), draw(st.integers(1, 4))
    separator = draw(st.sampled_from([",", ";", "\t"]))
    blanks = BLANKS if separator != "\t" else st.sampled_from(["", " "])
    header = HEADERS[draw(st.sampled_from(sorted(HEADERS)))]
    names = separator.join(("name", *header, "n"))
    lines = [["# made by " + draw(REMARKS)], ["# orientation: KUKA ABC"], [names]]
    for number in range(count):
        name = draw(st.sampled_from([f"P{number}", f'"a{separator} {number}"', "", "#"])) or f"Q{number}"
        line = [(name if name != "#" else "P") + separator]
        for _ in range(6):
            line[-1] += draw(blanks)
            line += [draw(number_texts(2.0)), draw(blanks) + separator]
        line[-1] += draw(st.sampled_from(["5", "", "text"]))
        lines.append(line)
        lines.append([draw(st.sampled_from(["", "# x"]))])
    return joined(lines, end), count
