/* All of the lanes for one instruction set: its file defines VEC_BYTES and NAME, and includes this. */
#include "control.h"
#include "dop853.h"
#include "dop853_tableau.h"
#include "lanes_vector.h"
#include "method.h"
#include "motion.h"
#include "project.h"
#include "sizes.h"
#include "watch.h"

/* each needs those before it */
#include "lanes_sincos.h"

#include "lanes_tape.h"

#include "lanes_solve.h"

#include "lanes_project.h"

#include "lanes_watch.h"

#include "lanes_dop853.h"

#include "lanes_sample.h"

#include "lanes_sizes.h"

#include "lanes_advance.h"

const lag_lane_kernel NAME = {lanes_advance, lanes_table, lanes_sincos};
