// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#define PLATFORM_WINDOWS 0
#define THIRD_PARTY_INCLUDES_START
#define THIRD_PARTY_INCLUDES_END
#define SPLATBUS_API
#define UCLASS(...)
#define USTRUCT(...)
#define UPROPERTY(...)
#define UFUNCTION(...)
#define TEXT(Words) u##Words
#define check(Condition) ((Condition) ? (void)0 : std::abort())

typedef std::uint8_t uint8;
typedef std::int32_t int32;
typedef std::uint32_t uint32;
typedef long long int64;
typedef char16_t TCHAR;

namespace Stub
{
	std::u16string To16(const std::string& Words);
	std::string To8(const std::u16string& Words);
	/** What was logged: its kind, and its words. */
	std::vector<std::string>& Logged();

	class FPrinted
	{
	public:
		explicit FPrinted(const TCHAR* InFormat) : Format(InFormat) {}
		FPrinted& operator<<(const TCHAR* Argument)
		{
			const size_t At = Format.find(u"%s");
			check(At != std::u16string::npos);
			Printed += Format.substr(0, At) + Argument;
			Format = Format.substr(At + 2);
			return *this;
		}
		std::string Whole() const { return To8(Printed + Format); }

	private:
		std::u16string Format, Printed;
	};

	template <class... T>
	void Log(const char* Kind, const TCHAR* Format, T... Arguments)
	{
		FPrinted Printed(Format);
		((void)(Printed << Arguments), ...);
		Logged().push_back(std::string(Kind) + ": " + Printed.Whole());
	}
}

#define UTF8_TO_TCHAR(Words) (Stub::To16(Words).c_str())
#define TCHAR_TO_UTF8(Words) (Stub::To8(Words).c_str())
#define UE_LOG(Category, Verbosity, ...) ((void)Category, Stub::Log(#Verbosity, __VA_ARGS__))
struct FLogCategory
{
};
#define DECLARE_LOG_CATEGORY_EXTERN(Name, Default, Most) extern FLogCategory Name
#define DEFINE_LOG_CATEGORY(Name) FLogCategory Name

class FString
{
public:
	FString() = default;
	FString(const TCHAR* InWords) : Words(InWords) {}
	const TCHAR* operator*() const { return Words.c_str(); }
	bool IsEmpty() const { return Words.empty(); }
	bool operator<(const FString& Other) const { return Words < Other.Words; }
	bool operator==(const FString& Other) const { return Words == Other.Words; }

private:
	std::u16string Words;
};

class FName
{
public:
	FName(const TCHAR* InWords) : Words(InWords) {}

private:
	FString Words;
};

template <class T>
class TArray
{
public:
	void Add(const T& Item) { Items.push_back(Item); }
	int32 Num() const { return static_cast<int32>(Items.size()); }
	T& operator[](int32 At) { return Items[static_cast<size_t>(At)]; }
	auto begin() const { return Items.begin(); }
	auto end() const { return Items.end(); }

private:
	std::vector<T> Items;
};

template <class K, class V>
struct TPair
{
	K Key;
	V Value;
};

template <class K, class V>
class TMap
{
public:
	void Add(const K& Key, const V& Value)
	{
		Remove(Key);
		Items.push_back({Key, Value});
	}
	void Remove(const K& Key)
	{
		Items.erase(std::remove_if(Items.begin(), Items.end(), [&](const auto& Each) { return Each.Key == Key; }), Items.end());
	}
	bool Contains(const K& Key) const
	{
		return std::any_of(Items.begin(), Items.end(), [&](const auto& Each) { return Each.Key == Key; });
	}
	auto begin() const { return Items.begin(); }
	auto end() const { return Items.end(); }

private:
	std::vector<TPair<K, V>> Items;
};

enum class ESPMode
{
	NotThreadSafe,
	ThreadSafe
};

template <class T, ESPMode Mode = ESPMode::ThreadSafe>
class TSharedPtr
{
public:
	TSharedPtr() = default;
	TSharedPtr(std::shared_ptr<T> InIt) : It(std::move(InIt)) {}
	bool IsValid() const { return It != nullptr; }
	T* Get() const { return It.get(); }
	T& operator*() const { return *It; }
	T* operator->() const
	{
		check(It);
		return It.get();
	}
	void Reset() { It.reset(); }

private:
	std::shared_ptr<T> It;
};

template <class T, ESPMode Mode = ESPMode::ThreadSafe>
class TSharedRef
{
public:
	TSharedRef(std::shared_ptr<T> InIt) : It(std::move(InIt)) {}
	T* operator->() const { return It.get(); }
	operator TSharedPtr<T, Mode>() const { return TSharedPtr<T, Mode>(It); }

private:
	std::shared_ptr<T> It;
};

template <class T, ESPMode Mode = ESPMode::ThreadSafe, class... A>
TSharedRef<T, Mode> MakeShared(A&&... Arguments)
{
	return TSharedRef<T, Mode>(std::make_shared<T>(std::forward<A>(Arguments)...));
}

template <class T>
using TFunction = std::function<T>;

template <class T>
class TObjectPtr
{
public:
	TObjectPtr(T* InIt = nullptr) : It(InIt) {}
	operator T*() const { return It; }
	T* operator->() const { return It; }

private:
	T* It;
};

template <class T>
class TWeakObjectPtr
{
public:
	TWeakObjectPtr(T* InIt = nullptr) : It(InIt) {}
	bool IsValid() const { return It != nullptr; }
	T* Get() const { return It; }

private:
	T* It;
};

struct FMath
{
	static double Abs(double Value) { return std::abs(Value); }
	static int32 TruncToInt32(double Value) { return static_cast<int32>(Value); }
};

struct FVector
{
	double X, Y, Z;
	FVector() {}
	FVector(double InX, double InY, double InZ) : X(InX), Y(InY), Z(InZ) {}
};
struct FVector2D
{
	double X, Y;
};
struct FVector4f
{
	float X, Y, Z, W;
	FVector4f() {}
	FVector4f(float InX, float InY, float InZ, float InW) : X(InX), Y(InY), Z(InZ), W(InW) {}
};

struct FRotator;
struct FQuat
{
	double X, Y, Z, W;
	FQuat() {}
	FQuat(double InX, double InY, double InZ, double InW) : X(InX), Y(InY), Z(InZ), W(InW) {}
	FQuat GetNormalized() const
	{
		const double Norm = std::sqrt(X * X + Y * Y + Z * Z + W * W);
		return FQuat(X / Norm, Y / Norm, Z / Norm, W / Norm);
	}
	FQuat operator*(const FQuat& B) const
	{
		return FQuat(W * B.X + X * B.W + Y * B.Z - Z * B.Y, W * B.Y - X * B.Z + Y * B.W + Z * B.X, W * B.Z + X * B.Y - Y * B.X + Z * B.W, W * B.W - X * B.X - Y * B.Y - Z * B.Z);
	}
	FVector Turned(const FVector& It) const
	{
		const FQuat There = *this * FQuat(It.X, It.Y, It.Z, 0) * FQuat(-X, -Y, -Z, W);
		return FVector(There.X, There.Y, There.Z);
	}
	FRotator Rotator() const;
};

/** In degrees: pitch looks up, yaw to the right, roll tilts the head to the right. */
struct FRotator
{
	static constexpr double Degree = 3.14159265358979323846 / 180;
	double Pitch, Yaw, Roll;
	FRotator() {}
	FRotator(double InPitch, double InYaw, double InRoll) : Pitch(InPitch), Yaw(InYaw), Roll(InRoll) {}
	FQuat Quaternion() const
	{
		const auto Half = [](double Degrees, double& Sine) {
			Sine = std::sin(Degrees * Degree / 2);
			return std::cos(Degrees * Degree / 2);
		};
		double Up, Right, Tilt;
		const double UpW = Half(Pitch, Up), RightW = Half(Yaw, Right), TiltW = Half(Roll, Tilt);
		return FQuat(0, 0, Right, RightW) * FQuat(0, -Up, 0, UpW) * FQuat(-Tilt, 0, 0, TiltW);
	}
};

inline FRotator FQuat::Rotator() const
{
	const FVector Ahead = Turned(FVector(1, 0, 0)), Side = Turned(FVector(0, 1, 0)), Above = Turned(FVector(0, 0, 1));
	return FRotator(std::asin(std::clamp(Ahead.Z, -1.0, 1.0)) / FRotator::Degree, std::atan2(Ahead.Y, Ahead.X) / FRotator::Degree, std::atan2(-Side.Z, Above.Z) / FRotator::Degree);
}

class FTransform
{
public:
	FQuat Rotation = FQuat(0, 0, 0, 1);
	FVector Location = FVector(0, 0, 0), Scale = FVector(1, 1, 1);
	FVector GetLocation() const { return Location; }
	FQuat GetRotation() const { return Rotation; }
	FVector GetScale3D() const { return Scale; }
};

/** A row vector times this. */
struct FMatrix
{
	double M[4][4];
};

struct FIntPoint
{
	int32 X, Y;
	FIntPoint(int32 InX = 0, int32 InY = 0) : X(InX), Y(InY) {}
};
struct FIntRect
{
	FIntPoint Min, Max;
	FIntRect() {}
	FIntRect(FIntPoint InMin, FIntPoint InMax) : Min(InMin), Max(InMax) {}
	FIntPoint Size() const { return FIntPoint(Max.X - Min.X, Max.Y - Min.Y); }
};

class UObject
{
public:
	virtual ~UObject() = default;
};
template <class T>
const T* GetDefault()
{
	return T::StubDefault();
}
