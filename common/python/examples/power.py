#!/usr/bin/env python3
"""What a study with n trainees can find: the smallest difference of a measure between two groups (POWER.md).

usage: power.py --scores FILE.csv --measure COLUMN [--groups COLUMN] [--trainees N…] [--difference D]
       power.py --spread SD [--trainees N…] [--difference D]"""
import argparse
import csv
import sys

import numpy as np
from scipy.optimize import brentq
from scipy.stats import nct, t as student

LEVEL, POWER, MOST = 0.05, 0.8, 100_000


def power(d, n):
    """Of the two-sided t test at 5 % with n trainees in each group whose means are d spreads apart (Cohen 1988)."""
    free, shift = 2 * n - 2, abs(d) * np.sqrt(n / 2)
    least = student.ppf(1 - LEVEL / 2, free)
    with np.errstate(divide="ignore"):  # far out the density is 0
        return nct.sf(least, free, shift) + nct.cdf(-least, free, shift)


def smallest(n):
    """The difference, in spreads, that n in each group find with a power of 80 %."""
    return brentq(lambda d: power(d, n) - POWER, 1e-3, 50)


def trainees_for(d):
    """The fewest in each group that find a difference of d spreads; None above 100,000."""
    low, high = 1, MOST
    if power(d, high) < POWER:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power(d, middle) >= POWER else (middle, high)
    return high


def number(cell):
    """A cell of either decimal sign; None: empty, nothing was measured."""
    cell = cell.strip()
    return float(cell.replace(",", ".")) if cell and cell.lower() != "nan" else None


def column(header, wanted):
    """Of this name, with or without its unit in brackets."""
    found = [name for name in header if name.lower() == wanted.lower() or name.lower().split(" [")[0] == wanted.lower()]
    if len(found) != 1:
        raise ValueError(f"column '{wanted}': {'several' if found else 'none'} of that name; there are {', '.join(header)}")
    return found[0]


def table(path, measure, person, groups):
    """(name of the column, group -> a value of each trainee: the mean over that trainee's rows)."""
    with open(path, newline="", encoding="utf-8-sig") as file:
        first = file.readline()
        file.seek(0)
        rows = list(csv.DictReader(file, delimiter=max(";\t,", key=first.count)))
    if not rows:
        raise ValueError(f"{path}: no rows below the header")
    header = list(rows[0])
    measure, person = column(header, measure), column(header, person)
    groups = column(header, groups) if groups else None
    values = {}
    for line, row in enumerate(rows, 2):
        try:
            value = number(row[measure])
        except ValueError:
            raise ValueError(f"{path} line {line}, column '{measure}': '{row[measure]}' is not a number") from None
        if value is not None:
            values.setdefault(row[groups] if groups else "", {}).setdefault(row[person], []).append(value)
    return measure, {group: np.array([np.mean(own) for own in people.values()]) for group, people in values.items()}


def pooled(groups):
    """The spread between trainees within groups, and its degrees of freedom."""
    free = sum(len(values) - 1 for values in groups)
    if free < 1:
        raise ValueError("a spread wants at least two trainees in a group")
    return np.sqrt(sum(((values - values.mean()) ** 2).sum() for values in groups) / free), free


def found(groups):
    """Hedges' g of two groups, and p of the t test."""
    (a, b), (spread, free) = groups, pooled(groups)
    d = (b.mean() - a.mean()) / spread
    p = 2 * student.sf(abs(d) / np.sqrt(1 / len(a) + 1 / len(b)), free)
    return d * (1 - 3 / (4 * free - 1)), p


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--scores", metavar="FILE.csv", help="a row for each attempt or exercise of a trainee (needlelab-admin results --out)")
    source.add_argument("--spread", type=float, help="standard deviation between trainees, in the measure's unit")
    parser.add_argument("--measure", help="a column of --scores, with or without its unit")
    parser.add_argument("--person", default="Person", help="the column that names the trainee (Person)")
    parser.add_argument("--groups", help="a column with two groups: the spread is that within them")
    parser.add_argument("--trainees", type=int, nargs="+", default=[4, 6, 8, 12, 16, 24, 32, 48], help="in each group")
    parser.add_argument("--difference", type=float, help="in the measure's unit: how many trainees find it")
    options = parser.parse_args()
    try:
        if min(options.trainees) < 2:
            raise ValueError(f"--trainees {min(options.trainees)}: at least 2 in each group")
        if options.difference == 0:
            raise ValueError("--difference 0: there is nothing to find")
        if options.scores:
            if not options.measure:
                raise ValueError("--measure: which column of --scores?")
            name, groups = table(options.scores, options.measure, options.person, options.groups)
            if options.groups and len(groups) != 2:
                raise ValueError(f"--groups {options.groups}: {len(groups)} groups ({', '.join(groups)}); two are compared")
            spread, _ = pooled(list(groups.values()))
            for group, values in groups.items():
                print(f"{group or 'all'}: {len(values)} trainees, mean {values.mean():.4g}")
            print(f"spread of {name} between trainees{' within groups' if options.groups else ''}: {spread:.4g}")
            if options.groups:
                g, p = found(list(groups.values()))
                print(f"difference here: Hedges' g {g:.2f}, p {p:.3g}")
        else:
            spread = options.spread
        if not spread > 0:
            raise ValueError("the spread is not above 0: nothing differs between trainees")
    except (ValueError, OSError) as error:
        print(f"power.py: {error}", file=sys.stderr)
        return 2
    print(f"\na two-sided t test at {100 * LEVEL:.0f} % finds with a power of {100 * POWER:.0f} %\n\n  in each group   in spreads   in the unit")
    for n in options.trainees:
        print(f"  {n:13d} {smallest(n):12.2f} {smallest(n) * spread:13.4g}")
    if options.difference:
        n = trainees_for(options.difference / spread)
        print(f"\na difference of {options.difference:.4g} ({abs(options.difference) / spread:.2f} spreads) wants {n or f'more than {MOST:,}'} in each group")
    return 0


if __name__ == "__main__":
    sys.exit(main())
