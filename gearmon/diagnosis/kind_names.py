"""Names of the kinds of fault that are told apart."""

#: Nothing is wrong with the gears: healthy, or something that repeats with no gear.
NONE = "none of these"
#: Kinds of fault that are told apart; the last is none of them.
KINDS = (
    "tooth damage",
    "several teeth",
    "distributed pitting",
    "wear",
    "eccentricity",
    "misalignment",
    "looseness",
    NONE,
)
