# Contact problems and impacts, for tests; see contact/contact.h.


cdef extern from "contact/contact.h" nogil:
    ctypedef struct lag_contacts:
        int n
        const double *matrix
        const double *offset
        const int32_t *law
        const double *static_limit
        const double *static_slope
        const double *kinetic_limit
        const double *kinetic_slope
        const double *rounding

    ctypedef struct lag_contact_motion:
        double *force
        double *motion
        int32_t *mode

    ctypedef struct lag_impact:
        int n
        const double *matrix
        const double *before
        const int32_t *law
        const double *restitution
        const double *friction
        const double *rounding
        void *phase

    ctypedef struct lag_impact_result:
        double *impulse
        double *after
        double *loss

    int lag_solve_contacts(
        const lag_contacts *problem, const int32_t *present, void *memory, lag_contact_motion *first,
        lag_contact_motion *second)
    int lag_share_contacts(
        const lag_contacts *problem, const int32_t *mode, void *memory, double *force, double *slack,
        int32_t *tight)
    size_t lag_contact_memory(int n)
    int lag_solve_impact(
        const lag_impact *impact, int law, void *memory, lag_impact_result *result)
    size_t lag_impact_memory(int n)


cdef class _Memory:
    cdef void *start

    def __cinit__(self, size_t size):
        self.start = malloc(size)
        if self.start == NULL:
            raise MemoryError

    def __dealloc__(self):
        free(self.start)


cdef lag_contacts _contacts(problem, _Arguments arguments):
    cdef lag_contacts c
    c.n, c.rounding = len(problem.offset), NULL
    c.matrix, c.offset = arguments.doubles(problem.matrix), arguments.doubles(problem.offset)
    c.law = arguments.integers(problem.laws)
    c.static_limit = arguments.doubles(problem.static)
    c.static_slope = arguments.doubles(problem.static_slopes)
    c.kinetic_limit = arguments.doubles(problem.kinetic)
    c.kinetic_slope = arguments.doubles(problem.kinetic_slopes)
    return c


def solve_contacts(problem, present=None):
    """Return the solutions of a contact problem, two at most: (force, motion, modes) of each.

    Parameters
    ----------
    problem : ContactProblem
    present : (n,) array of int, optional
        Modes to try first.
    """
    cdef _Arguments arguments = _Arguments()
    cdef lag_contacts c = _contacts(problem, arguments)
    cdef int n = c.n
    cdef const int32_t *modes = NULL
    if present is not None:
        modes = arguments.integers(present)
    reals, whole = np.zeros((2, 2, n + 1)), np.zeros((2, n + 1), dtype=np.int32)
    cdef double[:, :, ::1] out = reals
    cdef int32_t[:, ::1] mode = whole
    cdef lag_contact_motion first, second
    first.force, first.motion, first.mode = &out[0, 0, 0], &out[0, 1, 0], &mode[0, 0]
    second.force, second.motion, second.mode = &out[1, 0, 0], &out[1, 1, 0], &mode[1, 0]
    cdef _Memory memory = _Memory(lag_contact_memory(n))
    found = lag_solve_contacts(&c, modes, memory.start, &first, &second)
    return [(reals[i, 0, :n], reals[i, 1, :n], whole[i, :n]) for i in range(found)]


def share_contacts(problem, modes, force):
    """Return the forces of given modes, the common slack of the laws of redundant rows, and which are tight.

    Where the rows are not redundant, the forces are those given, and no slack is finite.

    Parameters
    ----------
    problem : ContactProblem
    modes : (n,) array of int
    force : (n,) array
        Forces of the modes.
    """
    cdef _Arguments arguments = _Arguments()
    cdef lag_contacts c = _contacts(problem, arguments)
    reals, whole = np.full((2, c.n), np.inf), np.zeros(c.n, dtype=np.int32)
    reals[0] = force
    cdef double[:, ::1] out = reals
    cdef int32_t[::1] tight = whole
    cdef _Memory memory = _Memory(lag_contact_memory(c.n))
    lag_share_contacts(&c, arguments.integers(modes), memory.start, &out[0, 0], &out[1, 0], &tight[0])
    return reals[0], reals[1], whole.astype(bool)


def solve_impact(matrix, before, laws, restitution, friction, int law):
    """Return how many motions follow an impact, up to 2, and impulses, velocities after, losses.

    Parameters
    ----------
    matrix, friction : (n, n) arrays
    before, restitution : (n,) arrays
    laws : (n,) array of int
    law : int
        0, Poisson's; 1, Newton's; 2, one contact at a time.
    """
    cdef _Arguments arguments = _Arguments()
    cdef int n = len(before)
    cdef lag_impact impact
    impact.n, impact.matrix, impact.rounding = n, arguments.doubles(matrix), NULL
    impact.phase = NULL
    impact.before, impact.law = arguments.doubles(before), arguments.integers(laws)
    impact.restitution, impact.friction = arguments.doubles(restitution), arguments.doubles(friction)
    reals = np.zeros((3, n + 1))
    cdef double[:, ::1] out = reals
    cdef lag_impact_result result
    result.impulse, result.after, result.loss = &out[0, 0], &out[1, 0], &out[2, 0]
    cdef _Memory memory = _Memory(lag_impact_memory(n))
    found = lag_solve_impact(&impact, law, memory.start, &result)
    return found, reals[0, :n], reals[1, :n], reals[2, :n]
