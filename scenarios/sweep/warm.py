"""What every worker needs, loaded once in the process that workers are forked from."""

from dim import Dim
from scenarios.library import four_way
from scenarios.recipe import Recipe
from scenarios.sweep.rows import outcome_of

# A short run loads the compiled kernel too.
outcome_of(Recipe(four_way(350.0, horizon=10.0), Dim(), 0))
