"""Mistakes in a motion file: a text is the file, the answer that of `armguard run`."""

import numpy as np

from mistakes.mistake import Mistake
from motion_files import HEADER, table, times

ROW = "0,0.5,0.1,0.5,0.1"
GIVE = "write one number a column, with a decimal point"

MOTION_FILE = {
    "degrees": Mistake(
        *("is at 45", "m.csv: configuration 2: joint 'a/turn'", "give radians"),
        table(ROW, "0.02,45,0.1,0.5,0.1"),
    ),
    "millimetres": Mistake(
        *("is at 100", "configuration 1: joint 'a/lift'", "give metres"),
        table("0,0.5,100,0.5,100"),
    ),
    "milliseconds": Mistake(
        *("20 s from one", "m.csv", "milliseconds; name the times 't_ms'"),
        times(0, 20, 40),
    ),
    "microseconds": Mistake(
        *("20000 s from one", "m.csv", "name the times 't_us'"), times(0, 2e4, 4e4)
    ),
    "nanoseconds": Mistake(
        *("2e+07 s from one", "m.csv", "name the times 't_ns'"), times(0, 2e7, 4e7)
    ),
    "nanoseconds of arms at rest": Mistake(
        *("2e+07 s from one", "m.csv", "name the times 't_ns'"),
        times(0, 2e7, 4e7, moves=0),
    ),
    "microseconds since 1970": Mistake(
        *("1.7e+15", "m.csv: 't'", "name its unit: 't_ms'"),
        times(1.7e15, 1.7e15 + 2e4),
    ),
    "times that are too short": Mistake(
        *("500 times its speed limit", "joint 'a/turn'", "write the unit"),
        times(0, 2e-5, 4e-5),
    ),
    "NaN": Mistake(
        *("is at nan", "joint 'a/lift'", "it must be finite"),
        table("0,0.5,nan,0.5,0.1"),
    ),
    "infinity": Mistake(
        *("is at inf", "joint 'a/lift'", "it must be finite"),
        table("0,0.5,inf,0.5,0.1"),
    ),
    "a NaN time": Mistake(
        *("is nan", "the time of configuration 2", "give a finite time, or delete the"),
        times(0, np.nan, 0.04),
    ),
    "an infinite time": Mistake(
        *("is inf", "the time of configuration 2", "give a finite time"),
        times(0, np.inf),
    ),
    "times that go back": Mistake(
        *("from 0.04 s to 0.02 s", "at configuration 3", "it must not go back: sort"),
        times(0, 0.04, 0.02),
    ),
    "a time twice": Mistake(
        *("the time 0.02 s", "configurations 2 and 3", "correct a time"),
        times(0, 0.02, 0.02, 0.04),
    ),
    "one time for all": Mistake(
        *("the time 3 s", "all 3 configurations", "correct the times, or leave them"),
        times(3, 3, 3, moves=0),
    ),
    "two columns of times": Mistake(
        *("are both times", "m.csv:1: columns 'time' and 't'", "delete one"),
        table("0," + ROW, header="time," + HEADER),
    ),
    "times without their name": Mistake(
        *("joint 'z'", "m.csv", "if it holds times, name it 't'"),
        table(ROW, ROW.replace("0", "1", 1), header="z" + HEADER[1:]),
    ),
    "joints in reverse order": Mistake(
        *("is at 0.5000", "joint 'a/lift'", "seem to be in reverse order"),
        table(ROW, header="t,b/lift,b/turn,a/lift,a/turn"),
    ),
    "another joint": Mistake(
        *("'a/lfit'", "m.csv: joint", "did you mean 'a/lift'"),
        table(ROW, header=HEADER.replace("a/lift", "a/lfit")),
    ),
    "another robot": Mistake(
        *("no robot is named 'c'", "joint 'c/turn'", "known names are 'a', 'b'"),
        table(ROW, header=HEADER.replace("a/", "c/")),
    ),
    "a joint of either robot": Mistake(
        *("joint 'turn'", "may be 'a/turn' or 'b/turn'", "write the robot's name"),
        table("0,0.5,0.1", header="t,turn,lift"),
    ),
    "a missing joint": Mistake(
        *("no positions for", "'b/lift'", "hold them at home with --hold-home"),
        table("0,0.5,0.1,0.5", header="t,a/turn,a/lift,b/turn"),
    ),
    "a column twice": Mistake(
        *("'a/turn' is there twice", "m.csv:1", "delete one"),
        table(ROW, header=HEADER.replace("b/turn", "a/turn")),
    ),
    "a joint by two names": Mistake(
        *("'a/turn' and 'a_turn'", "joint 'a/turn'", "delete one"),
        table(ROW, header=HEADER.replace("b/turn", "a_turn")),
    ),
    "no header": Mistake(
        *("it holds numbers", "m.csv:1", "the first line must hold the joint names"),
        ROW + "\n",
    ),
    "no row": Mistake(
        *("there is no configuration", "m.csv", "give at least one"), table()
    ),
    "an empty file": Mistake(
        *("the first line", "m.csv:1", "must hold the joint names"), ""
    ),
    "a row that is too short": Mistake(
        *("3 columns; the header has 5", "m.csv:3", GIVE), table(ROW, "0.02,0.5,0.1")
    ),
    "decimal commas": Mistake(
        *("9 columns; the header has 5", "m.csv:2", GIVE), table("0,0,5,0,1,0,5,0,1")
    ),
    "a decimal comma in quotes": Mistake(
        *("'0,5' is no number", "m.csv:2", GIVE), table('0,"0,5",0.1,0.5,0.1')
    ),
    "another separator": Mistake(
        *("1 columns; the header has 5", "m.csv:2", GIVE),
        table(ROW, header=HEADER.replace(",", ";")),
    ),
    "text": Mistake(
        *("'half' is no number", "m.csv:2", GIVE), table("0,half,0.1,0.5,0.1")
    ),
    "an empty cell": Mistake(
        *("'' is no number", "in column 'a/turn'", GIVE), table("0,,0.1,0.5,0.1")
    ),
    "a date": Mistake(
        *("'2026-01-01T00:00:00' is no number", "in column 't'", GIVE),
        table("2026-01-01T00:00:00,0.5,0.1,0.5,0.1"),
    ),
    "UTF-16": Mistake(
        *("is no text in UTF-8", "'m.csv'", "save it as CSV in UTF-8"),
        times(0, 0.02).encode("utf-16"),
    ),
}
