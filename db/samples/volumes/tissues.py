"""What the structures of the patients feel like: the forces of the samples beside (db/samples/*.json), by region.

A needle's cutting force, attraction and rejection in N, lateral stiffness in N/m², friction in N/m, and a membrane at
the structure's entry (linear N/m, quadratic N/m², rupture N). `sources` of each profile says where they are from.
"""


def layer(tissue, cutting, attracted, rejection, lateral, friction, membrane=None):
    made = {"tissue": tissue, "cutting_force_n": cutting, "attracted_force_n": attracted,
            "rejection_force_n": rejection, "lateral_stiffness_n_per_m2": lateral, "friction_n_per_m": friction}
    if membrane:
        linear, quadratic, force = membrane
        made["puncture"] = {"linear_n_per_m": linear, "quadratic_n_per_m2": quadratic, "force_n": force}
    return {key: float(value) if isinstance(value, (int, float)) else value for key, value in made.items()}


def softened(made, shares):
    """The layer of a frail or a strong body: its forces times the first share, its friction times the second."""
    share, friction = shares
    found = dict(made)
    for key in ("cutting_force_n", "attracted_force_n", "rejection_force_n"):
        found[key] = round(found[key] * share, 3)
    found["lateral_stiffness_n_per_m2"] = round(found["lateral_stiffness_n_per_m2"] * share, -2)
    found["friction_n_per_m"] = round(found["friction_n_per_m"] * friction, 1)
    if "puncture" in found:
        found["puncture"] = {**found["puncture"], "force_n": round(found["puncture"]["force_n"] * share, 3)}
    return found


BONE = layer("BONE", 4, 0.4, 0.1, 20000, 40)
NERVE = layer("OTHER", 0.8, 0.3, 0.05, 4000, 15)
VESSEL = layer("OTHER", 0.5, 0.2, 0.05, 2500, 10)
CARTILAGE = layer("CARTILAGE", 3, 0.4, 0.1, 15000, 30)
