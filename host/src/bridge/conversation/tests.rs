use std::net::{Ipv4Addr, SocketAddr};

use rfhoi_shared::wire::{MAGIC, Telemetry, VERSION};

use super::*;

const PEER: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::new(192, 168, 33, 30)), 4780);
const SEED: u16 = 65_535;

/// The bridge's side of the conversation.
struct Bridge(Sequencer);

impl Bridge {
    fn says(&mut self, message: Message<'_>) -> Vec<u8> {
        let packet = self.0.wrap(BridgeTime(7), message);
        packet.encode(&mut [0; MAX_PACKET]).unwrap().to_vec()
    }

    fn acks(&mut self, id: u16, outcome: Result<(), Refusal>) -> Vec<u8> {
        self.says(Message::Ack(Ack { id, at: BridgeTime(7), outcome }))
    }
}

fn conversation(now: Instant) -> (Conversation, Bridge) {
    (Conversation::new(PEER, SEED, now), Bridge(Sequencer::new(1)))
}

fn hello() -> Hello {
    Hello { board: Default::default(), id: [2; 6], firmware: [0, 1, 0], cube_bytes: 1, profile: 2 }
}

/// The command that the conversation sends now.
fn sent(conversation: &mut Conversation, now: Instant) -> Command {
    let Step::Send(bytes) = conversation.step(now) else { panic!("nothing to send") };
    match Packet::decode(&bytes).unwrap().message {
        Message::Command(command) => command,
        other => panic!("a host sends commands, not {other:?}"),
    }
}

#[test]
fn an_answer_ends_the_request() {
    let now = Instant::now();
    let (mut host, mut bridge) = conversation(now);
    host.ask(Request::Stop, now);
    let command = sent(&mut host, now);
    assert_eq!((command.id, &command.request), (SEED, &Request::Stop));
    assert_eq!(host.step(now), Step::Wait(now + RESEND_AFTER));
    host.take(PEER, &bridge.acks(command.id, Ok(())));
    let want = Answer { outcome: Outcome::Done, boot: 1, hello: None, config: None };
    assert_eq!(host.step(now), Step::Answered(want));
    // The next request has the next number, past the end of the numbers too.
    host.ask(Request::Start, now);
    assert_eq!(sent(&mut host, now).id, 0);
    host.take(PEER, &bridge.acks(0, Err(Refusal::Busy)));
    assert!(matches!(
        host.step(now),
        Step::Answered(Answer { outcome: Outcome::Refused(Refusal::Busy), .. })
    ));
}

#[test]
fn requests_are_repeated_with_their_number_until_they_are_given_up() {
    let start = Instant::now();
    let (mut host, _) = conversation(start);
    host.ask(Request::Restart, start);
    let mut now = start;
    for _ in 0..attempts(&Request::Restart) {
        assert_eq!(sent(&mut host, now).id, SEED);
        let Step::Wait(until) = host.step(now) else { panic!("sent twice at once") };
        now = until;
    }
    assert_eq!(host.step(now), Step::Failed(Failure::Unanswered));
    assert_eq!(now - start, RESEND_AFTER * attempts(&Request::Restart));
}

#[test]
fn answers_in_two_parts_take_both_in_any_order_and_from_two_attempts() {
    let now = Instant::now();
    let (mut host, mut bridge) = conversation(now);
    host.ask(Request::Hello, now);
    let id = sent(&mut host, now).id;
    let waiting = Step::Wait(now + RESEND_AFTER);
    host.take(PEER, &bridge.acks(id, Ok(())));
    assert_eq!(host.step(now), waiting, "the hello itself was lost");
    let later = now + RESEND_AFTER;
    assert_eq!(sent(&mut host, later).id, id);
    host.take(PEER, &bridge.says(Message::Hello(hello())));
    let Step::Answered(answer) = host.step(later) else { panic!("both parts are there") };
    assert_eq!((answer.outcome, answer.hello), (Outcome::Done, Some(hello())));

    host.ask(Request::GetConfig, now);
    let id = sent(&mut host, now).id;
    host.take(PEER, &bridge.says(Message::Config(BridgeConfig::default())));
    assert_eq!(host.step(now), waiting, "not acknowledged yet");
    host.take(PEER, &bridge.acks(id, Ok(())));
    let Step::Answered(answer) = host.step(now) else { panic!("both parts are there") };
    assert_eq!(answer.config, Some(BridgeConfig::default()));
}

#[test]
fn doubled_and_belated_answers_change_nothing() {
    let now = Instant::now();
    let (mut host, mut bridge) = conversation(now);
    host.ask(Request::Stop, now);
    let id = sent(&mut host, now).id;
    for _ in 0..2 {
        host.take(PEER, &bridge.acks(id, Ok(())));
    }
    assert!(matches!(host.step(now), Step::Answered(_)));
    host.ask(Request::Start, now);
    sent(&mut host, now);
    host.take(PEER, &bridge.acks(id, Err(Refusal::Busy)));
    assert_eq!(host.step(now), Step::Wait(now + RESEND_AFTER), "that was the answer to the request before");
}

#[test]
fn other_bridges_and_other_packets_are_not_heard() {
    let now = Instant::now();
    let (mut host, mut bridge) = conversation(now);
    host.ask(Request::Stop, now);
    let id = sent(&mut host, now).id;
    let other = SocketAddr::new(Ipv4Addr::new(192, 168, 33, 31).into(), PEER.port());
    let ack = bridge.acks(id, Ok(()));
    assert_eq!(host.take(other, &ack), None);
    assert_eq!(host.take(PEER, b"GET / HTTP/1.1"), None);
    assert_eq!(host.take(PEER, &ack[..ack.len() - 1]), None);
    assert!(host.take(PEER, &bridge.says(Message::Telemetry(Telemetry::default()))).is_some());
    assert_eq!(host.step(now), Step::Wait(now + RESEND_AFTER));
    assert_eq!(host.boot(), Some(1));
}

#[test]
fn a_bridge_that_came_back_has_restarted_whatever_it_says() {
    let now = Instant::now();
    let (mut host, mut bridge) = conversation(now);
    host.take(PEER, &bridge.says(Message::Telemetry(Telemetry::default())));
    let mut restarted = Bridge(Sequencer::new(2));
    // Its acknowledgement was lost; as it starts its radar at once, it would refuse the repetition.
    host.ask(Request::Configure(BridgeConfig::default()), now);
    let id = sent(&mut host, now).id;
    host.take(PEER, &restarted.acks(id, Err(Refusal::Busy)));
    let Step::Answered(answer) = host.step(now) else { panic!("the restart answers") };
    assert_eq!((answer.outcome, answer.boot), (Outcome::Restarted, 2));
    // What does not restart a bridge is simply done by the new one.
    host.ask(Request::Stop, now);
    let id = sent(&mut host, now).id;
    host.take(PEER, &Bridge(Sequencer::new(3)).acks(id, Ok(())));
    assert!(matches!(host.step(now), Step::Answered(Answer { outcome: Outcome::Done, boot: 3, .. })));
}

#[test]
fn another_version_is_told_at_once() {
    let now = Instant::now();
    let (mut host, mut bridge) = conversation(now);
    host.ask(Request::Hello, now);
    sent(&mut host, now);
    let mut packet = bridge.acks(SEED, Ok(()));
    packet[MAGIC.len()] = VERSION - 1;
    host.take(PEER, &packet);
    let error = WireError::Version { theirs: VERSION - 1, ours: VERSION };
    assert_eq!(host.step(now), Step::Failed(Failure::Version(error)));
}
