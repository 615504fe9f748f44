#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_paper.py [TEX]: guarantees that docs/paper.md has a row for each
symbol, equation, figure and table of the paper, which is not in the repository.

NAMES lists them by the paper's sections, as the first column of the rows
writes them. With TEX, the paper's source, also compares the list with its
labels and the number of its equations.
"""
import re
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parent.parent / "docs/paper.md"

NAMES = {
    "Gaussian Splatting": """
        g_j N mu_j q_j s_j alpha_j c_j Sigma_j R_j G_j(p) p C(p) T_j""",
    "ScaffoldGS": """
        x_i f_i l_i K O_i o_ik mu_ik f^_i delta_i d_i F_alpha F_c F_q F_s
        alpha_ik c_ik q_ik s_ik""",
    "Representation": """
        u_c l_c f_c u_f o_mi f_f l_f f~_c(u_f) f~_f(u_g) F_fine PE o_mij N_mi
        u_g theta_geo F_geo F_color c_cs d_c tau_s H_r D_res I~_cs""",
    "Compression": """
        Z z_meta z_hyper z_coarse z_fine z_hash z_net v_n gamma omega K_c G_lk
        K_c^coarse K_c^fine""",
    "Initialization": """
        P x_q tau_q h_q w_q eta_alpha eta_v eta_r eta_g alpha_q v_q r_q g_q phi_q
        lambda_tau lambda_h A_m P_m H_m alpha beta epsilon N_m N_budget N_min
        N_max x_mi tau_mi x_c tau_c l_c^x l_c^tau""",
    "Morton ordering": "kappa_m^c kappa_mi^f kappa_mi B_f",
    "Interpolation": """
        l A_l u_q l_q b u_b x_b tau_b l_b f_b kappa_b d(q,b) lambda_t kappa_q
        Win_M rho C_M(q) N_K(q) TopK w_qb T f~(u_q) Fuse""",
    "Context modeling": """
        r B_r S_r s_r1 s_rL L g q_g Read_phi mu_g sigma_g E_phi e_hp h_parent
        h_prev h_mem z_g a_r Agg_phi v_rp w_rp W_phi^p v_perp s_rp Norm""",
    "Optimization": """
        D_render lambda_r R(Z) lambda_A L_A lambda_res L_res eta I^_cs I_cs
        SSIM O_A ReLU rho_A Delta""",
    "equations": " ".join(f"eq.{i}" for i in range(1, 8)),
    "figures and tables": """
        fig:teaser fig:framework fig:shareability fig:interpolation
        fig:rd-ssim-lpips tab:nvs tab:bdrate_comparison tab:neu3d_analysis
        Table3a Table3b Table3c V1 V5""",
}


def firsts(page):
    """Returns the first columns of all rows, without blanks inside names."""
    rows = re.findall(r"^\| (.*?) \|", page, re.M)
    text = " | ".join(rows)
    text = text.replace("eq. ", "eq.").replace("(q, b)", "(q,b)")
    return re.sub(r"Table (\d\w?)", r"Table\1", text)


def without_row():
    """Yields the names that no row has."""
    text = firsts(PAGE.read_text("ascii"))
    for section, names in NAMES.items():
        for name in names.split():
            if not re.search(rf"(?<![\w~]){re.escape(name)}(?![\w~^])", text):
                yield f"{section}: {name}"


def without_name(tex):
    """Yields the labels of the paper that are not in the list, and the number
    of equations if it is another."""
    tex = re.sub(r"(?<!\\)%.*", "", tex)
    known = " ".join(NAMES.values()).split()
    for label in re.findall(r"\\label\{((?:fig|tab):.*?)\}", tex):
        if label not in known:
            yield f"{label} is not in the list"
    n = len(re.findall(r"\\begin\{equation\}", tex))
    if f"eq.{n}" not in known or f"eq.{n + 1}" in known:
        yield f"the paper has {n} equations"


def main():
    wrong = [f"no row: {name}" for name in without_row()]
    if len(sys.argv) > 1:
        wrong += without_name(Path(sys.argv[1]).read_text("utf-8"))
    for line in wrong:
        print(f"     {line}")
    n = sum(len(names.split()) for names in NAMES.values())
    print(f"{'FAIL' if wrong else 'ok  '} paper: {n} symbols, equations, "
          "figures, tables")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
