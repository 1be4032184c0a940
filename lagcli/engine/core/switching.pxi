"""Runs whose constraints switch; engine/switching/switching.py."""


cdef class SwitchingIntegrator(Integrator):
    """Steps with projection on a System whose rows switch.

    Parameters
    ----------
    split : SplitSystem
    frozen : FrozenSystem or None
        Where the System has kinks: what ``split`` is of.
    impacts : int
        The law of impacts, counted as in core/contact/contact.h.
    closed : float
        The gap that counts as none.
    log_rows : int
        Entries of the log that are kept before they are passed on.
    clocks : sequence of (Ticks, int)
        Clocks of events, and the largest number of their ticks, 0 without a limit.
    changes : (n, 2 nq) array or None
        Derivatives of q and v at the start, in n directions.
    arguments
        Of `Integrator`, for ``split.fixed``.
    """

    cdef object split, log
    cdef int rows, conditions, clocks, kinks, first_branch, directions

    def __init__(
        self, split, frozen, int impacts, double closed, long log_rows, clocks, changes, *arguments
    ):
        from lagcli.engine.switching.problem import ContactLaw

        super().__init__(*arguments, len(split.rows), changes)
        self.directions = 0 if changes is None else len(changes)
        cdef _Arguments given = _Arguments()
        cdef lag_switching_rules r
        system, switching, pattern = split.system, split.switching, split.pattern
        nothing = Tape(system.dynamics.inputs, (), (), (), system.dynamics.parameters)
        cdef lag_program empty = given.program(assemble(nothing))
        rows, extra = switching.rows, len(split.rows) - len(switching.rows)
        place = {constraint: i for i, constraint in enumerate(split.rows)}
        self.split, self.rows = split, len(split.rows)
        r.rows, r.exported, r.nc = self.rows, len(rows), len(system.constraints)
        r.constraint, r.base = given.integers(split.rows), given.integers(split.base)
        laws = [
            ContactLaw.UNILATERAL if row.sign
            else ContactLaw.FREE if row.limit is None
            else ContactLaw.LIMITED
            for row in rows
        ]
        r.law = given.integers([*laws, *[ContactLaw.FREE] * extra])
        r.limit = given.integers([*(-1 if x.limit is None else x.limit for x in rows), *[-1] * extra])
        normals = [-1 if x.normal is None else place[x.normal] for x in rows]
        r.normal = given.integers([*normals, *[-1] * extra])
        r.place = given.integers(split.places)
        r.sign = given.doubles([*(x.sign or 1 for x in rows), *[1.0] * extra])
        r.active = given.integers([*(x.active for x in rows), *[1] * extra])
        contacts = [i for i, x in enumerate(rows) if x.sign]
        limited = [i for i, x in enumerate(rows) if x.limit is not None]
        r.restitution = given.integers(
            [contacts.index(i) if i in contacts else -1 for i in range(self.rows)]
        )
        r.friction = given.integers(
            [len(contacts) + limited.index(i) if i in limited else -1 for i in range(self.rows)]
        )
        r.nb, r.nh = len(pattern), sum(i >= 0 for i in split.places)
        r.row = given.integers([i for i, _ in pattern])
        r.column = given.integers([j for _, j in pattern])
        r.functions = given.program(split.program(split.functions)) if split.rows else empty
        r.gaps = given.program(split.program(split.gaps)) if r.nh else empty
        r.limits = given.program(split.program(switching.limits)) if switching.limits.outputs else empty
        r.pattern_count = len(switching.limit_pattern)
        r.nl = (len(switching.limits.outputs) - 2 * r.pattern_count) // 2
        r.pattern_limit = given.integers([i for i, _ in switching.limit_pattern])
        r.pattern_row = given.integers([place[j] for _, j in switching.limit_pattern])
        r.impact = given.program(split.program(switching.impact)) if switching.impact.outputs else empty
        r.nf, r.force_count = len(switching.force_coordinates), len(switching.force_pattern)
        r.force_coordinate = given.integers(switching.force_coordinates)
        r.force_row = given.integers([i for i, _ in switching.force_pattern])
        r.force_constraint = given.integers([j for _, j in switching.force_pattern])
        r.forces = given.program(split.program(switching.forces)) if switching.forces else empty
        conditions, force_conditions = system.events, switching.force_conditions
        r.conditions = len(conditions.outputs) if conditions else 0
        r.force_conditions = len(force_conditions.outputs) if force_conditions else 0
        self.conditions = r.conditions + r.force_conditions
        r.condition_functions = given.program(split.program(conditions)) if conditions else empty
        r.force_condition_functions = (
            given.program(split.program(force_conditions)) if force_conditions else empty
        )
        either = {rule.condition for rule in switching.events if rule.either}
        r.either = given.integers([i in either for i in range(self.conditions)])
        times = [*switching.condition_times, *[False] * self.conditions]
        r.time = given.integers(times[: self.conditions])
        self.clocks = r.clocks = len(clocks)
        r.ticks = given.doubles([x for ticks, _ in clocks for x in ticks])
        r.most = given.integers([most for _, most in clocks])
        changes = ("closes", "opens", "slips", "sticks", "impacts")
        reported = np.zeros((self.rows, len(changes)), dtype=np.int32)
        for rule in switching.events:
            if rule.change is not None:
                reported[place[rule.change[0]], changes.index(rule.change[1])] = 1
        r.reported = given.integers(reported)
        kinks = frozen.kinks if frozen else ()
        self.kinks, self.first_branch = len(kinks), len(system.parameters) - len(kinks)
        r.kinks, r.first_branch = self.kinks, self.first_branch
        r.whole = given.integers([x.whole for x in kinks])
        r.of_time = given.integers([x.timed for x in kinks])
        r.kink_functions = given.program(split.program(frozen.functions)) if frozen else empty
        r.law_of_impact, r.closed = impacts, closed
        width = 6 + r.exported + 3 * self.nq + r.nc + self.directions
        self.log = np.empty((max(log_rows, 8 * self.rows + 8), width))
        cdef double[:, ::1] log = self.log
        r.log, r.log_rows = &log[0, 0], len(self.log)
        _checked(lag_use_switching(self.run, &r))

    def take_log(self):
        """Return the entries of the log since the last call: core/switching/log.c."""
        return self.log[: lag_take_log(self.run)].copy()

    def happened(self):
        """Return the conditions that have happened at this instant and were not asked for yet."""
        return [i for i in range(self.conditions) if lag_condition_happened(self.run, i)]

    def ticked(self):
        """Return the clocks that tick at this instant and were not asked for yet."""
        return [i for i in range(self.clocks) if lag_clock_ticks(self.run, i)]

    @property
    def next_tick(self):
        """Time of the next tick of a clock; infinity without one."""
        return lag_next_tick(self.run)

    def holding(self):
        """Return the conditions that hold."""
        return [i for i in range(self.conditions) if lag_condition_holds(self.run, i)]

    @property
    def modes(self):
        """Modes of the rows, `RowMode`."""
        cdef lag_instant_report report = lag_instant_of(self.run)
        return [report.mode[i] for i in range(self.rows)]

    @property
    def contacts(self):
        """φ, ψ and the forces of the rows, by their signs, at the last contact problem: (3, rows)."""
        cdef lag_instant_report report = lag_instant_of(self.run)
        return np.array([
            _copy(report.gap, self.rows), _copy(report.speed, self.rows), _copy(report.force, self.rows)
        ])

    @property
    def gain(self):
        """Energy that the last impact would gain, J; whether it had friction; one restitution."""
        cdef lag_instant_report report = lag_instant_of(self.run)
        return report.gained, bool(report.rubbed), bool(report.alike)

    @property
    def margin(self):
        """How unique the forces are while something slips: 1 without friction, 0 where it jams."""
        return lag_instant_of(self.run).margin

    @property
    def unresolved(self):
        """The function whose sign is not determined: "row", "kink" or "condition", and its index."""
        cdef lag_instant_report report = lag_instant_of(self.run)
        return ("row", "kink", "condition")[report.undetermined], report.which

    @property
    def struck(self):
        """The rows that take part in the last impact."""
        cdef lag_instant_report report = lag_instant_of(self.run)
        return [i for i in range(self.rows) if report.takes_part[i]]

    @property
    def problem(self):
        """The last contact problem of accelerations: its rows, and (force, motion, modes) of its motions."""
        from lagcli.engine.switching.problem import ContactProblem, ContactSolution

        cdef lag_contact_report r = lag_contacts_of(self.run)
        cdef int n = r.n
        problem = ContactProblem(
            _copy(r.matrix, n * n).reshape(n, n),
            _copy(r.offset, n),
            np.array([r.law[i] for i in range(n)]),
            _copy(r.static_limit, n),
            _copy(r.kinetic_limit, n),
            _copy(r.static_slope, n * n).reshape(n, n),
            _copy(r.kinetic_slope, n * n).reshape(n, n),
        )
        motions = [
            ContactSolution(
                _copy(r.force[k], n), _copy(r.motion[k], n), np.array([r.mode[k][i] for i in range(n)])
            )
            for k in range(lag_instant_of(self.run).found)
        ]
        return [r.row[i] for i in range(n)], problem, motions

    def place(self, y):
        """Set the state at an instant."""
        cdef double[::1] view = np.ascontiguousarray(y, dtype=float)
        lag_place(self.run, &view[0])

    def activate(self, int row, bint active):
        """Let a row take part, or leave."""
        lag_activate(self.run, row, active)

    def no_gap(self, int row):
        """Return the gap of a row that counts as none."""
        return lag_gap_of_none(self.run, row)

    def set_parameters(self, p):
        """Set the values of all parameters, without the branches of kinks."""
        cdef _Arguments given = _Arguments()
        first = self.first_branch
        lag_set_parameters(self.run, given.doubles([*p[:first], *self.branches, *p[first:]]))

    @property
    def branches(self):
        """Values of the branches."""
        return _copy(lag_instant_of(self.run).branches, self.kinks).tolist()

    @property
    def crossings(self):
        """How often a branch has changed, and how often a motion has begun to slide on a surface."""
        cdef lag_instant_report report = lag_instant_of(self.run)
        return report.crossed, report.slid

    @property
    def surfaces(self):
        """The kinks whose functions vanish at the instant."""
        cdef lag_instant_report report = lag_instant_of(self.run)
        return [i for i in range(self.kinks) if report.kinks[i]]

    def push(self, impulse, changes=None):
        """Apply a generalized impulse, whose derivatives are ``changes``, (n, nq)."""
        cdef _Arguments given = _Arguments()
        if changes is None:
            return lag_push(self.run, given.doubles(impulse), NULL)
        return lag_push(self.run, given.doubles(impulse), given.doubles(changes))

    def use_directions(self, directions):
        """Differentiate the motion.

        Parameters
        ----------
        directions : DirectionalPrograms
        """
        cdef _Arguments given = _Arguments()
        cdef lag_directions d
        d.parameters, d.p = directions.parameters.shape[1], given.doubles(directions.parameters)
        d.decides = given.integers(directions.decides)
        d.dynamics = given.program(directions.dynamics)
        d.constraint = given.program(directions.constraint)
        d.functions = given.program(directions.functions)
        d.limits = given.program(directions.limits)
        d.impact = given.program(directions.impact)
        d.forces = given.program(directions.forces)
        d.conditions = given.program(directions.conditions)
        d.force_conditions = given.program(directions.force_conditions)
        d.kinks = given.program(directions.kinks)
        d.kink_rates = given.program(directions.kink_rates)
        _checked(lag_use_directions(self.run, &d))

    def changes(self, int parameters):
        """Return derivatives at an instant: of the state, of the parameters, and of a and λ."""
        constraints = len(self.split.system.constraints)
        state = np.empty((self.directions, 2 * self.nq))
        forces = np.empty((self.directions, self.nq + constraints))
        cdef double[:, ::1] of_state = state
        p = np.empty((self.directions, max(parameters, 1)))
        cdef double[:, ::1] of_p = p
        cdef double[:, ::1] of_forces = forces
        lag_read_changes(self.run, &of_state[0, 0], &of_p[0, 0], &of_forces[0, 0])
        return state, p[:, :parameters], forces

    def set_changes(self, state, parameters):
        """Set derivatives where an action has changed the state or the parameters."""
        cdef _Arguments given = _Arguments()
        lag_set_changes(self.run, given.doubles(state), given.doubles(parameters))

    def change_of_time(self, condition=None):
        """Return the derivatives of the time of the instant, or of that of a condition."""
        which = -1 if condition is None else condition
        return _copy(lag_change_of_time(self.run, which), self.directions)

    @property
    def losses(self):
        """Of each direction without derivatives: its number, since when, why, and of what."""
        cdef lag_loss_report r
        found = []
        for k in range(self.directions):
            r = lag_loss_of(self.run, k)
            if r.lost:
                culprits = [(r.what[i], r.which[i]) for i in range(r.count)]
                found.append((k, r.t, r.reason, culprits))
        return found

    @property
    def begun(self):
        """Whether the modes at the start are known."""
        return bool(lag_instant_of(self.run).begun)

    @property
    def first_modes(self):
        """Modes of the rows at the start."""
        cdef lag_instant_report report = lag_instant_of(self.run)
        return [report.first_mode[i] for i in range(self.rows)]

    @property
    def motion(self):
        """The state as the instant begins, and a and λ of all constraints there."""
        cdef lag_instant_report report = lag_instant_of(self.run)
        constraints = len(self.split.system.constraints)
        return _copy(report.before, self.n), _copy(report.a, self.nq), _copy(report.multipliers, constraints)

    def sample_here(self):
        """Return a status, and the sample row of the present state, as in the block."""
        row = np.empty(self.block.shape[1])
        cdef double[::1] view = row
        return lag_sample_here(self.run, &view[0]), row
