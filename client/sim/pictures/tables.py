#!/usr/bin/env python3
"""Tables of the pages of client/sim, made from a program's JSON.

usage: tables.py skill|benchmark RESULT.json README.md      puts the table between its two lines in the page; `draw` does it
"""
import json
import sys


def begin_of(part):
    return f"<!-- {part}: made by client/sim/pictures/draw -->"


def end_of(part):
    return f"<!-- end of {part} -->"


def part_of(page, part):
    """The text between the two lines of a part; None where the page lacks them."""
    _, begin, rest = page.partition(begin_of(part) + "\n")
    inside, end, _ = rest.partition(end_of(part))
    return inside if begin and end else None


def with_part(page, part, inside):
    """The page with another text between the two lines of a part."""
    before = part_of(page, part)
    if before is None:
        raise ValueError(f"no {begin_of(part)} … {end_of(part)}")
    begin, end = begin_of(part) + "\n", end_of(part)
    return page.replace(begin + before + end, begin + inside + end)


def markdown(head, rows):
    lines = [head, ["---"] * len(head)] + rows
    return "".join("|" + "|".join(cells if cells[0] == "---" else [f" {cell} " for cell in cells]) + "|\n" for cells in lines)


def skill(result):
    """A row for each measure, in the program's order."""
    head = ["measure", "better", "novices", "experts", "unit", "Hedges' g (95 %)", "Cliff's delta", "p", "p (Holm)", "separates",
            "500 Hz – 2 kHz (may be)"]

    def effect(row):
        if row["hedges_g"] is None:
            return "∞"
        return f"{row['hedges_g']:.1f} ({row['g_low_95']:.1f} … {row['g_high_95']:.1f})"

    return markdown(head, [[f"`{row['measure']}`", row["better"], f"{row['novice_mean']:.3g}", f"{row['expert_mean']:.3g}", row["unit"],
                            effect(row), f"{row['cliffs_delta']:.2f}", f"{row['p']:.4f}", f"{row['p_holm']:.3f}", row["separates"],
                            f"{row['rate_difference']:.3g} ({row['rate_tolerance']:g})"] for row in result["rows"]])


def benchmark(result):
    """A row for each model: its numbers and its mean error in N in each question."""
    questions = [question["held_out"] for question in result["questions"]]
    rows = {}  # by model, and which of its rows it is; in the program's order
    for question in questions:
        seen = {}
        for row in (row for row in result["rows"] if row["held_out"] == question):
            seen[row["model"]] = seen.get(row["model"], 0) + 1
            label = f"`{row['model']}`" + (", membranes" if row["variant"].startswith("PUNCTURE") else "")
            cells = rows.setdefault((row["model"], seen[row["model"]]), {"label": label})
            cells[question] = [str(row["parameters"]), f"{row['error_n']:.3f}"]
    head = ["model"] + [cell for question in questions for cell in ("numbers", f"`{question}`")]
    return markdown(head, [[cells["label"]] + [cell for question in questions for cell in cells.get(question, ["", ""])]
                           for cells in rows.values()])


TABLES = {"skill": skill, "benchmark": benchmark}


def main(arguments):
    part, result, page = arguments
    with open(result, encoding="utf-8") as file:
        table = TABLES[part](json.load(file))
    with open(page, encoding="utf-8") as file:
        text = file.read()
    with open(page, "w", encoding="utf-8") as file:
        file.write(with_part(text, part, table))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
