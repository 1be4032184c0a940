/* All functions of lanes for one instruction set: the including file defines VEC_BYTES and NAME. */
#include "left_out.h"
#include "methods/control.h"
#include "methods/dop853.h"
#include "methods/dop853_tableau.h"
#include "batch/batch_vector.h"
#include "methods/method.h"
#include "motion.h"
#include "project.h"
#include "project_system.h"
#include "sizes.h"
#include "solution.h"
#include "watch.h"

/* each depends on those before it */
#include "batch/batch_sincos.h"

#include "batch/batch_tape.h"

#include "batch/batch_solve.h"

#include "batch/batch_project.h"

#include "batch/batch_watch.h"

#include "batch/batch_left_out.h"

#include "batch/batch_dop853.h"

#include "batch/batch_sample.h"

#include "batch/batch_sizes.h"

#include "batch/batch_advance.h"

const lag_batch_kernel NAME = {batch_advance, batch_table, batch_sincos, batch_tape_run};
