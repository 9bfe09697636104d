"""The best subsets of many terms by leaps and bounds, proved without fitting every subset (Furnival and Wilson 1974).

The search drops terms. A node holds the terms that stay, the open terms, and the fit of both together: no subset of
them has a smaller SSE. Its child drops one open term and keeps the more significant ones, so each subset occurs once.
A node is pruned if no subset within it can enter the list. A bound on the joint cost of several drops shows this early.
With G the products of the columns, b the coefficients of all terms of the node and H = G^-1,

    SSE(without the terms D) - SSE = b_D' (H_DD)^-1 b_D >= sum_D w_j b_j^2/H_jj,   1/w_j = sum_l |H_jl|/sqrt(H_jj H_ll)

since a matrix with a unit diagonal lies below the diagonal of its absolute row sums; the q cheapest terms give the
bound for q drops. The rows of R^-1 (columns = Q R) are the dual basis: H are their products, and dropping a term
projects the others across its own, which loses digits like the condition number, not like its square.

Coefficients >= 0: a node is fitted by non-negative least squares on its terms, and the same bound holds about that fit.
Only terms that it does not hold at 0 need to be dropped: a subset with every coefficient > 0 that contains all of them
has no other term, since the solution is unique.

Leave-one-out error: each subset of a node has leverages of at least h, those of the terms that stay, so its sum of
squared errors is at least sum_i w_i e_i^2, w = 1/(1 - h)^2. That is a quadratic form above G, bounded about its own
least value: with a = Q'(W - 1) e, by sum_i w_i e_i^2 - |a|^2 and the costs of drops with b + R^-1 a in place of b.

No library of Python does this: R's leaps has neither signs nor leave-one-out and does not end within two minutes on the
40 terms of ``benchmarks.best_subset``, abess proves nothing.
"""

from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import BoolArray, FloatArray, IntArray
from damping.errors import AnalysisError
from damping.regression.criteria import LARGEST_LEVERAGE, Shortlist, SubsetProblem, leave_one_out, state_problem
from damping.regression.design import Basis, Design, solve_nonnegative

#: Multiplications that a search may take, about two minutes; a node takes k^2, by leave-one-out n k more.
MOST_WORK = 4e9
#: Numbers of one batch of nodes: a few megabytes, small beside what numpy takes for each call.
_BATCH_NUMBERS = 2**18
#: Nodes of the first batch. It doubles, so that good subsets are known before many nodes are opened.
_FIRST_BATCH = 8


@dataclass(frozen=True)
class Proof:
    """Proof that a search is complete.

    No subset that qualifies has a score below ``bound``, the best score less its possible rounding error.
    """

    subsets: int  #: 2^k - 1
    nodes: int  #: fits that decided them
    bound: float


@dataclass(frozen=True)
class _Nodes:
    """Nodes b with up to m open terms."""

    inside: BoolArray  #: the terms in or open (b, k)
    terms: IntArray  #: the open ones, the first ``counts`` of a row (b, m)
    counts: IntArray  #: (b,)
    duals: FloatArray  #: their dual vectors within the span of ``inside``, 0 beyond the counts (b, m, k)
    rest: FloatArray  #: of the response across that span (b, k)
    leverages: FloatArray  #: of all terms inside (b, n), (b, 0) where they are not needed

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def is_open(self) -> BoolArray:
        """Whether each term is open, (b, m)."""
        return np.asarray(np.arange(self.terms.shape[1]) < self.counts[:, None])

    @property
    def stay(self) -> BoolArray:
        """The terms that are in every subset of a node (b, k)."""
        stay = self.inside.copy()
        rows, columns = np.nonzero(self.is_open)
        stay[rows, self.terms[rows, columns]] = False
        return stay


@dataclass
class _Opened:
    """Nodes with the children to visit (c,), most promising last."""

    nodes: _Nodes
    parents: IntArray  #: the node
    drops: IntArray  #: the position of the dropped term

    def pop(self, number: int) -> tuple[IntArray, IntArray]:
        taken = self.parents[-number:], self.drops[-number:]
        self.parents, self.drops = self.parents[:-number], self.drops[:-number]
        return taken


def search(design: Design, basis: Basis, criterion: str, *, nonnegative: bool, number: int) -> tuple[BoolArray, int]:
    """The subsets (m, k) among the ``number`` best, and the number of nodes.

    If rounding does not decide between several, all of them are returned, in no order.

    AnalysisError: the search would take more than ``MOST_WORK``.
    """
    problem = state_problem(design, basis, criterion, nonnegative)
    first = Shortlist(problem, number, np.full(problem.k + 1, np.inf))
    if not nonnegative:
        _eliminate(problem, first)
    best = Shortlist(problem, number, first.limits)
    most = int(MOST_WORK / problem.cost)
    largest = max(_BATCH_NUMBERS // (problem.k**2 + (design.n if problem.leaves_out else 0)), 1)
    batch, visited = min(_FIRST_BATCH, largest), 1
    waiting = [_visit(_root(problem), problem, best)]
    while waiting:
        if not len(waiting[-1].parents):
            waiting.pop()
            continue
        children = _children(waiting[-1].nodes, *waiting[-1].pop(batch), problem)
        visited += len(children)
        if visited > most:
            raise AnalysisError(
                f"the best of 2^{problem.k} - 1 subsets is not proved after {most} fits, the most that are made; "
                "give fewer terms or select them stepwise"
            )
        waiting.append(_visit(children, problem, best))
        batch = min(2 * batch, largest)
    return best.members, visited


def _eliminate(problem: SubsetProblem, best: Shortlist) -> None:
    """Enter the models of backward elimination: from all terms on, each model with one term less than the best."""
    root = _root(problem)
    inside, duals, rest, leverages = root.inside[0], root.duals[0], root.rest[0], root.leverages[0]
    for _ in range(problem.k - 1):
        terms = np.flatnonzero(inside)
        directions = duals[terms] / np.sqrt(np.einsum("mk,mk->m", duals[terms], duals[terms]))[:, None]
        amounts = directions @ problem.along
        subsets = np.repeat(inside[None], len(terms), axis=0)
        subsets[np.arange(len(terms)), terms] = False
        rests = rest + directions * amounts[:, None]
        if problem.leaves_out:
            left = leverages - (directions @ problem.orthonormal.T) ** 2
            best.enter(subsets, np.asarray(leave_one_out(problem.deviations(rests), left)))
        else:
            best.enter(subsets, problem.sse(rests))
        least = int(np.argmin(np.abs(amounts)))
        inside, rest, direction = subsets[least], rests[least], directions[least]
        leverages = left[least] if problem.leaves_out else leverages
        duals = duals - np.outer(duals @ direction, direction)


def _root(problem: SubsetProblem) -> _Nodes:
    """All terms, all open."""
    k, n = problem.k, len(problem.observed) if problem.leaves_out else 0
    leverages = np.einsum("nk,nk->n", problem.orthonormal, problem.orthonormal)[:n]
    everything = np.ones((1, k), dtype=np.bool_)
    return _Nodes(everything, np.arange(k)[None], np.array([k]), problem.duals[None], np.zeros((1, k)), leverages[None])


def _children(nodes: _Nodes, parents: IntArray, drops: IntArray, problem: SubsetProblem) -> _Nodes:
    """The nodes that drop a term; open terms before it stay open, those after it stay in."""
    rows = np.arange(len(parents))
    direction = nodes.duals[parents, drops]
    direction = direction / np.sqrt(np.einsum("bk,bk->b", direction, direction))[:, None]
    most = int(drops.max())
    duals = nodes.duals[parents, :most]
    for _ in range(2):  # the second time takes off what rounding of the first has left
        duals = duals - np.matmul(duals, direction[:, :, None]) * direction[:, None, :]
    duals[np.arange(most) >= drops[:, None]] = 0.0
    inside, leverages = nodes.inside[parents], nodes.leverages[parents]
    inside[rows, nodes.terms[parents, drops]] = False
    if problem.leaves_out:
        leverages = leverages - (direction @ problem.orthonormal.T) ** 2
    rest = nodes.rest[parents] + direction * (direction @ problem.along)[:, None]
    return _Nodes(inside, nodes.terms[parents, :most], drops, duals, rest, leverages)


def _visit(nodes: _Nodes, problem: SubsetProblem, best: Shortlist) -> _Opened:
    """Fit nodes, enter their subsets, and open the children that may qualify."""
    stay = nodes.stay
    if problem.nonnegative:
        coefficients, rest = _nonnegative(nodes, problem)
        subsets = coefficients > 0.0
        standing = (subsets | ~stay).all(axis=1)
        numbers = np.take_along_axis(coefficients, nodes.terms, axis=1) * nodes.is_open
    else:
        subsets, rest, standing = nodes.inside, nodes.rest, np.ones(len(nodes), dtype=np.bool_)
        numbers = nodes.duals @ problem.along
    sse = problem.sse(rest)
    if not problem.leaves_out:
        best.enter(subsets[standing], sse[standing])
        return _open(nodes, numbers, numbers, sse, stay, best)
    deviations = problem.deviations(rest)
    leverages = nodes.leverages
    if problem.nonnegative:
        directions = [
            problem.orthonormal @ np.linalg.qr(problem.factor[:, members])[0] for members in subsets[standing]
        ]
        leverages = np.array([np.einsum("nk,nk->n", d, d) for d in directions]).reshape(-1, len(problem.observed))
    best.enter(subsets[standing], np.asarray(leave_one_out(deviations[standing], leverages)))
    least, change = _weighted(nodes, deviations, problem)
    return _open(nodes, numbers, numbers + change, least, stay, best)


def _nonnegative(nodes: _Nodes, problem: SubsetProblem) -> tuple[FloatArray, FloatArray]:
    """Coefficients (b, k) of non-negative least squares on the terms inside, and residuals of the response (b, k)."""
    coefficients = np.zeros(nodes.inside.shape)
    for row, inside in zip(coefficients, nodes.inside, strict=True):
        if inside.any():
            row[inside] = solve_nonnegative(problem.factor[:, inside], problem.along)
    return coefficients, problem.along - coefficients @ problem.factor.T


def _weighted(nodes: _Nodes, deviations: FloatArray, problem: SubsetProblem) -> tuple[FloatArray, FloatArray]:
    """The least sum of squared leave-one-out errors within nodes (b,), and the change of the coefficients of open terms
    (b, m) there."""
    open_directions = np.linalg.qr(nodes.duals.transpose(0, 2, 1))[0][:, :, : nodes.duals.shape[1]]
    open_directions = open_directions * nodes.is_open[:, None, : open_directions.shape[2]]
    within = np.matmul(problem.orthonormal, open_directions)
    stay = np.clip(nodes.leverages - np.einsum("bnm,bnm->bn", within, within), 0.0, LARGEST_LEVERAGE)
    excess = (1.0 / (1.0 - stay) ** 2 - 1.0) * deviations
    shift = excess @ problem.orthonormal
    least = np.einsum("bn,bn->b", deviations, deviations + excess) - np.einsum("bk,bk->b", shift, shift)
    return least, np.matmul(nodes.duals, shift[:, :, None])[:, :, 0]


def _open(
    nodes: _Nodes, coefficients: FloatArray, about: FloatArray, least: FloatArray, stay: BoolArray, best: Shortlist
) -> _Opened:
    """The children of nodes that may have subsets for the list.

    ``coefficients`` (b, m) of the open terms, 0 where they are held; ``least`` (b,) sum of squares within a node, taken
    at the coefficients ``about`` (b, m).
    """
    is_open = nodes.is_open
    droppable = (coefficients != 0.0) & is_open if best.problem.nonnegative else is_open
    products = np.matmul(nodes.duals, nodes.duals.transpose(0, 2, 1))
    squares = np.where(is_open, np.einsum("bmm->bm", products), 1.0)
    length = np.sqrt(squares)
    row_sums = np.einsum("bml,bl->bm", np.abs(products), 1.0 / length) / length
    alone = np.where(droppable, about**2 / squares, 0.0)
    costs = np.where(is_open, alone / np.maximum(row_sums, 1.0), np.inf)
    costs = np.where(droppable | ~is_open, costs, -1.0)  # held terms come first
    order = np.argsort(costs, axis=1, kind="stable")
    costs, alone, droppable = (np.take_along_axis(part, order, axis=1) for part in (costs, alone, droppable))
    costs = np.where(droppable, costs, 0.0)
    # of the positions before a child's own, how many more are dropped: the fewest terms left, their least cost
    more = np.cumsum(droppable, axis=1) - droppable
    sizes = np.maximum(stay.sum(axis=1)[:, None] + droppable.sum(axis=1)[:, None] - 1 - more, 1)
    spent = np.cumsum(costs, axis=1) - costs
    room = np.maximum.accumulate(best.reach[sizes] - spent, axis=1) - least[:, None] - costs
    room = np.minimum(room, best.reach[sizes] - least[:, None] - alone)
    worth = droppable & (room >= 0.0) & (nodes.inside.sum(axis=1) > 1)[:, None]
    parents, drops = np.nonzero(worth)
    promise = np.argsort(room[parents, drops], kind="stable")
    terms = np.take_along_axis(nodes.terms, order, axis=1)
    duals = np.take_along_axis(nodes.duals, order[:, :, None], axis=1)
    return _Opened(replace(nodes, terms=terms, duals=duals), parents[promise], drops[promise])
