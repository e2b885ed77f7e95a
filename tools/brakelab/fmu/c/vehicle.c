/* The simulated vehicle: demands are held between communication points, as if each were sent in every cycle. */
static int moved(instance *of, int call, int returned) {
    int failed = run(of, call);
    of->now.script_ended = !of->places[call][returned];
    return failed;
}

static int begin_unit(instance *of) { return moved(of, MEASURE, AT_MEASURE[4]); }

static int step_unit(instance *of, int64_t t_ns, bool communicates) {
    (void)t_ns, (void)communicates;
    return moved(of, GO_ON, AT_GO_ON[5]);
}
