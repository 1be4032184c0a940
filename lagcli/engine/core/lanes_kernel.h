/* All of the lanes for one instruction set: its file defines VEC_BYTES and NAME, and includes this. */
#include "lanes_vector.h"

#include "lanes_sincos.h"
#include "lanes_tape.h"

#include "motion.h"

#include "lanes_solve.h"

#include "lanes_project.h"

#include "lanes_watch.h"

#include "lanes_dop853.h"

#include "lanes_sample.h"

#include "lanes_advance.h"

const lag_lane_kernel NAME = {lanes_advance, lanes_table, lanes_sincos};
