#include "assets/rig.h"
