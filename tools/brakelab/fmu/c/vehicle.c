/* The simulated vehicle: demands are held between communication points, as if each were sent in every cycle. */
enum { TOGETHER = 5 }; /* four demands and whether they are valid, of pressure and then of motors */

static int moved(instance *of, int call, int returned) {
    int failed = run(of, call);
    of->now.script_ended = !of->places[call][returned];
    return failed;
}

static int begin_unit(instance *of) { return moved(of, MEASURE, AT_MEASURE[4]); }

/* What is beyond the range of its frame is sent as its end; of those that belong together all have arrived, or none. */
static int step_unit(instance *of, int64_t t_ns, bool communicates) {
    (void)t_ns, (void)communicates;
    double *heard = (double *)(of->now.memory + TAKEN_AT);
    for (uint32_t first = 1; VARIABLES[first].kind == INPUT; first += TOGETHER) {
        bool arrived = true;
        for (uint32_t one = first; one < first + TOGETHER; one++) arrived = arrived && isfinite(*number(of, one));
        for (uint32_t one = first; one < first + TOGETHER; one++) {
            const variable *known = &VARIABLES[one];
            heard[known->place] = arrived ? fmin(fmax(*number(of, one), known->low), known->high) : NAN;
        }
    }
    return moved(of, GO_ON, AT_GO_ON[5]);
}
