/// The searches that kernels have: the traversals of the kd-tree, and that of the grids. A module has the code of one
/// search, which the macro `TRAVERSAL` selects, since drivers take seconds to compile the code of all of them.
const SEARCH_MODULES: [&str; 9] =
    ["mask", "mask_boxes", "restart", "backtrack", "short_stack", "ropes", "stack", "brute", "grid"];
