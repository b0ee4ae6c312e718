"""The autopilot's loops of heading and bank: a coordinated turn, and the rate of the bank angle.

    heading   phi_c = V / g (psi_c' + K (psi_c - psi) + M)    `bank_to_turn`       M: missing_turn_rate
    bank      phi_c' = K (phi_c - phi) + M                    `bank_angle_rate`    M: missing_roll_rate

Both M are in rad/s. ap: record AUTOPILOT (autopilot_setup.py). Other letters: autopilot.py.
"""

from beaver_ftc.aircraft import ROLL, YAW
from beaver_ftc.compiled import kernel
from beaver_ftc.control.profile import BANK, HEADING, clamp
from beaver_ftc.plant.instruments import wrapped

MOST_DRIFT_RAD_S = 0.1  # largest M of the turn rate: a bank that is held without a turn
LOOP_GAIN_SHARE_BY_POWER = 0.25  # factor on both loops where engines alone yaw the aircraft


@kernel
def bank_angle_rate(ap, attitude):
    """phi_c' = share K (phi_c - phi) + roll_loss M, the rate of the bank angle, rad/s:

        share = 1 - roll_loss engine_yaw_share (1 - LOOP_GAIN_SHARE_BY_POWER)
        M <- M + roll_loss dt share K_i (phi_c - phi)        unless limited

    The loop is slower where engines alone yaw and roll the aircraft. phi_c is within bank_limit. If neither
    heading nor bank is commanded, the rate is 0.
    """
    gain = ap.gain
    roll_loss = ap.roll_loss_share
    share = 1.0 - roll_loss * ap.engine_yaw_share * (1.0 - LOOP_GAIN_SHARE_BY_POWER)
    if ap.is_commanded[HEADING]:
        bank = bank_to_turn(ap, share, attitude[YAW])
    elif ap.is_commanded[BANK]:
        bank = ap.command[BANK]
    else:
        return 0.0
    error = clamp(bank, ap.bank_limit) - attitude[ROLL]
    demand = share * gain.bank * error + roll_loss * ap.missing_roll_rate
    rate = clamp(demand, ap.rate_limit[ROLL])
    if rate == demand:
        ap.missing_roll_rate += roll_loss * ap.dt * share * gain.bank_i * error
    return rate


@kernel
def bank_to_turn(ap, share, heading):
    """phi_c = V / g (psi_c' + share loose K (psi_c - psi) + M), rad: bank of the coordinated turn to the
    commanded heading.

        loose = 1 - yaw_loss (1 - gain.loose)
        M <- yaw_loss (M + dt yaw_loss K_i (psi_c - psi))        M within MOST_DRIFT_RAD_S

    So where nothing acts in yaw, the loop is slower, and integrates its error.
    """
    gain = ap.gain
    yaw_loss = ap.yaw_loss_share
    error = wrapped(ap.command[HEADING] - heading)
    loose = 1.0 - yaw_loss * (1.0 - gain.loose)
    M = ap.missing_turn_rate + ap.dt * yaw_loss * gain.heading_i * error
    ap.missing_turn_rate = yaw_loss * clamp(M, MOST_DRIFT_RAD_S)
    turning = share * loose * gain.heading * error + ap.command_rate[HEADING]
    return ap.airspeed / ap.gravity * (turning + ap.missing_turn_rate)
