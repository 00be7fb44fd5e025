// SPDX-License-Identifier: MIT
#include "SplatBusSubsystem.h"

#include "SplatBusConnection.h"
#include "SplatBusSettings.h"

namespace SplatBusStart
{
	/** Of the settings where they say one, else of the environment, which the client has read. */
	int Port(int32 Set, int Found, const char* Name, std::string& Problem)
	{
		const int Port = Set != 0 ? Set : Found;
		if (Port < 1 || Port > 65535)
		{
			Problem = std::string(Name) + " is no port from 1 to 65535" + (Set != 0 ? ": " + std::to_string(Port) : std::string());
		}
		return Port;
	}
}

void USplatBusSubsystem::Initialize(FSubsystemCollectionBase& Collection)
{
	Super::Initialize(Collection);
	Ticker = FTSTicker::GetCoreTicker().AddTicker(FTickerDelegate::CreateUObject(this, &USplatBusSubsystem::Turn));
}

void USplatBusSubsystem::Deinitialize()
{
	FTSTicker::GetCoreTicker().RemoveTicker(Ticker);
	Connection.Reset();
	Super::Deinitialize();
}

TArray<FString> USplatBusSubsystem::GetProblems() const
{
	TArray<FString> Problems;
	if (!StartProblem.IsEmpty())
	{
		Problems.Add(StartProblem);
	}
	if (Connection.IsValid())
	{
		Connection->ListProblems(Problems);
	}
	return Problems;
}

bool USplatBusSubsystem::SendTime(double Seconds)
{
	return Connection.IsValid() && Connection->Client.send_time(Seconds) == nullptr;
}

bool USplatBusSubsystem::Begin(const UObject* View)
{
	if (Owner)
	{
		return false;
	}
	Owner = View;
	if (!Connection.IsValid())
	{
		Connect();
	}
	return true;
}

void USplatBusSubsystem::End(const UObject* View, bool bLevelChanges)
{
	if (Owner != View)
	{
		return;
	}
	Owner = nullptr;
	if (!bLevelChanges)
	{
		Connection.Reset();
		StartProblem = FString();
	}
}

bool USplatBusSubsystem::Turn(float)
{
	if (Connection.IsValid())
	{
		Connection->HearNews();
	}
	return true;
}

void USplatBusSubsystem::Connect()
{
	const USplatBusSettings* Settings = GetDefault<USplatBusSettings>();
	splatbus::ClientOptions Options = splatbus::ClientOptions::from_environment(); // the token comes from there alone
	Options.name = "splatbus-unreal";
	if (!Settings->Host.IsEmpty())
	{
		Options.host = SplatBusText(Settings->Host);
	}
	std::string Problem;
	Options.ipc_port = SplatBusStart::Port(Settings->IpcPort, Options.ipc_port, Settings->IpcPort != 0 ? "IpcPort" : "SPLATBUS_IPC_PORT", Problem);
	Options.message_port = SplatBusStart::Port(Settings->MessagePort, Options.message_port, Settings->MessagePort != 0 ? "MessagePort" : "SPLATBUS_MSG_PORT", Problem);
	StartProblem = SplatBusWords(Problem);
	if (!Problem.empty())
	{
		UE_LOG(LogSplatBus, Warning, TEXT("%s"), *StartProblem);
		return;
	}
	Connection = MakeShared<FSplatBusConnection>(std::move(Options));
}
