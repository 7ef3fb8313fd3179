"""What is run and edited from a checkout: trainings, the tables, proofs. The learners lie in chmarl_pb.learning."""

from chmarl_pb.extras import check
from chmarl_pb.signals import begin_loading, is_program

if is_program("training"):  # whose modules import torch, which takes seconds, before they run
    begin_loading("training")
check("training", "train", "torch")
