"""What is said of a mistake that is made in more than one place; what belongs to one question only
stands in its set.

A row of a catalogue is name, what to say, old and new text:
`("innovation-sign", messages.INNOVATION_SIGN, "y - h", "h - y")`. A message names the kind of
mistake and never the answer, and it is right in every question in which it is used.
"""

# -- means, variances, derivatives

DEVIATION_FOR_VARIANCE = "It is a standard deviation; the variance is asked for."
ABOUT_ZERO = "It is the second moment about zero; a variance is about the mean."
MEANS_NOT_SUBTRACTED = "The second moments are taken about zero; covariances are about the means."
OFFSET_FORGOTTEN = (
    "The offset is the target's mean; what the matrix makes of the regressor's "
    "mean has to be subtracted."
)
DIFFERENT_DIVISORS = (
    "Cross covariance and covariance are divided by different numbers, N and N - 1; np.cov "
    "divides by N - 1 unless told "
    "otherwise."
)
CORRELATIONS_IGNORED = (
    "Only the variances of the components are used; the errors are correlated: "
    "use the inverse of the whole matrix."
)
ONE_SIDED_DIFFERENCE = (
    "That is a one-sided difference; take a step to either side, the error is "
    "then of the second order."
)
SIGNAL_FOR_DERIVATIVE = "The signal itself stands where its derivative belongs."
NEGATIVE_ROOT = "That is the other root of the quadratic equation; a variance is not negative."
NOISE_PART_FORGOTTEN = "The noise adds to the covariance too; only the state's part is there."

# -- the correction

INNOVATION_SIGN = "The innovation has the wrong sign: it is what came minus what was expected."
MEASUREMENT_FOR_INNOVATION = (
    "The measurement itself is multiplied by the gain; subtract what was expected."
)
GAIN_WITHOUT_PSI = (
    "The covariance Psi of the prediction is missing in the gain: how sure was the filter before?"
)
COVARIANCE_KEPT = (
    "The covariance is that of the prediction: a measurement must make the filter surer."
)
COVARIANCE_ADDED = "The covariance grows: what the measurement explains is subtracted."
INFORMATION_FOR_COVARIANCE = "That is the information, not the covariance: invert the sum."
GAIN_BY_NOISE_ALONE = (
    "The gain is divided by the meter's noise alone; the prediction's error "
    "belongs to the innovation too."
)
NOISE_INHERITED = (
    "The estimate inherits noise from the measurement through the gain: a term is missing."
)
STATE_FOR_EXPECTED = (
    "The prediction of the state is subtracted; what is expected of y is what "
    "the meter makes of it."
)
NOISE_SQUARED = "The covariance of the meter's noise enters squared."
GAIN_MULTIPLIED = "The gain is multiplied by the covariance of the innovation; it is divided by it."
ONE_COVARIANCE_TOO_MANY = (
    "A covariance is added that the prediction's function has taken into account already."
)
CORRECTION_ALONE = "That is the correction alone; it is added to the prediction."
CORRECTION_SUBTRACTED = "The correction is subtracted; it is added to the prediction."

# -- regressions

UNBIASED_RESIDUAL = "What is left is divided by N - 1, at least in part; use 1/N throughout."
ERROR_FOR_RESIDUAL = (
    "That is the covariance of x - z; what the regression leaves of x is asked for."
)
SCALE_FORGOTTEN = (
    "The matrix Gamma is missing: the regression changes the scale too, not only the offset."
)

# -- a run

PREDICTED_FIRST = (
    "The filter predicts before the first measurement; the prior is already the law "
    "of x_0, so correct with y_0 first."
)
PREDICTIONS_RETURNED = (
    "These are the predictions, before each measurement; return the estimates, after it."
)
MISSING_AS_ZERO = (
    "A missing measurement is treated as the number 0; it says nothing, so the prediction stays."
)

# -- a model with time and inputs

INPUT_FORGOTTEN = (
    "A term that is known at every step is missing in the mean: time and inputs move the state too."
)
STEP_NOT_PASSED = (
    "The functions are those of one step throughout; time and inputs change: give "
    "them the number of each step."
)
INPUT_OF_NEXT_STEP = (
    "The prediction from step k to k + 1 takes time and input of step k, not of step k + 1."
)
INPUT_OF_STEP_BEFORE = (
    "Time and input of the step before are taken: y_k and the prediction from "
    "x_k take those of step k."
)
STEPS_FROM_ONE = "The steps are counted from 1; the first measurement is y_0, that of step 0."

# -- continuous time: densities are one-sided

BOTH_ONE_SIDED = "The densities are one-sided: the intensity of the noise is not the whole of them."
DENSITIES_FOR_INTENSITIES = "Both densities are one-sided; the equation wants intensities."
PROCESS_ONE_SIDED = (
    "The density of the process noise is one-sided; its intensity is not the whole of it."
)
METER_ONE_SIDED = (
    "The density of the meter's noise is one-sided; its intensity is not the whole of it."
)
GAIN_ONE_SIDED = "The gain is divided by the one-sided density; the intensity belongs there."
DISCRETE_GAIN = (
    "That is the gain of a discrete filter; beside the noise of an instant the "
    "state's part is negligible."
)
RICCATI_SIGN = "The sign of the last term: what is measured makes D smaller."

# -- motion, radar, navigation

HALF_MISSING = "A factor is missing where the acceleration acts on the position: integrate twice."
CORRELATION_SIGN = "Position and velocity are pushed the same way: their covariance is positive."
SMALL_ALPHA = "That holds for small alpha only."
DECIMAL_LOGARITHM = "A decimal logarithm stands in the place of the natural one."
POWER_OF_T = "A power of T is missing: check the units."
POWER_OF_DT = "A power of dt is missing: check the units."
ORDER_OF_COMPONENTS = (
    "The order of the components is another: the state is (x, y, vx, vy), both positions first."
)
WHITE_IN_CONTINUOUS_TIME = (
    "That is for an acceleration that is white noise in continuous time; "
    "here it is constant over each interval."
)
SQUARES_NOT_MEANS = "The errors are averaged before they are squared; average the squares."
INVERSE_FORGOTTEN = (
    "The covariance itself stands between the errors; its inverse belongs there: "
    "an unsure filter may err."
)
AZIMUTH_FROM_Y = "The azimuth is counted from the y axis; here it goes from x towards y."
GAINS_SWAPPED = "alpha and beta are swapped."
SMALL_DRIFT = (
    "That is the limit for a drift much smaller than the noise; the exact value is asked for."
)
LEFT_AFTER_A_STEP = "What is left of an old error after a step is 1 + K, and K is negative."
